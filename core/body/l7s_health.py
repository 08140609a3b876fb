"""What an L7S run says about itself (spec/estimators.md §7)."""

from __future__ import annotations

from typing import Any, Final, cast

import numpy as np

from core.body.health import LONGEST_MOVING_S, Finding, longest_run_s
from core.body.poses import Poses
from core.errors import Notice
from core.frames import Protocol, Segment

CONSTRAINT_MM: Final = (1.0, 10.0)
"""What constraints leave after projection: below .01 with two, 10 accepted with one
(spec/estimators.md §6.4)."""

LEVEL: Final[tuple[Protocol, ...]] = ("squat", "activity", "tug")
"""Protocols in which the pelvis does not keep its height, as L7S takes it to."""


def l7s_health(poses: Poses) -> tuple[Finding, ...]:
    """Judge a run of `l7s_poses` by its own quantities."""
    d = cast("dict[str, Any]", poses.diagnostics)
    found = []
    for side in d["hinge_m"]:
        foot: Segment = "foot_l" if side == "left" else "foot_r"
        leg = f"leg_{side[0]}"
        moving = longest_run_s(~np.asarray(poses.contact[foot]), poses.rate_hz)
        found += [
            Finding("longest_moving_s", foot, moving, *LONGEST_MOVING_S),
            Finding("leg_excess_mm", leg, 1e3 * d["excess_m"][side], *CONSTRAINT_MM),
            Finding("hinge_mm", leg, 1e3 * d["hinge_m"][side], *CONSTRAINT_MM),
            # the leg's length is only bounded from above: at the bound the knee is straight, whatever it did
            Finding("knee_straight_pct", leg, 100.0 * d["knee_straight_share"][side]),
            Finding("foot_turned_deg", foot, float(np.degrees(d["foot_turned_rad"][side]))),
        ]
    found.append(Finding("min_eigenvalue", None, float(d["min_eigenvalue"])))
    return tuple(found)


def l7s_notices(protocol: Protocol) -> tuple[Notice, ...]:
    """What must be said about a take that this estimator is not made for."""
    if protocol not in LEVEL:
        return ()
    message = (
        f"L7S takes the pelvis to stay at its standing height; in '{protocol}' it does not. Read its angles "
        "and positions for walking parts only, or wear seven sensors."
    )
    return (Notice("pelvis_height_assumed", message),)
