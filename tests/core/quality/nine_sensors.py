"""The nine sensors of neura_walk: seven on the legs and the pelvis, two at the ankles."""

from __future__ import annotations

from sagittal.core.frames import Segment

NINE: dict[str, Segment | None] = {
    "00B40B91": "pelvis", "00B40C45": "thigh_l", "00B40C3C": "thigh_r", "00B40BA5": "shank_l",
    "00B40C35": "shank_r",
    "00B40C55": "foot_l", "00B40C48": "foot_r", "00B40C44": None, "00B40C47": None,
}  # fmt: skip
"""Device id → where it is worn, None = at an ankle."""
