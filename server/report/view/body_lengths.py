"""Body segment lengths used by an analysis, with method and origin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from sagittal.core.body.model import NOMINAL_HEIGHT_M
from sagittal.server.report.words.wording import format_number

TITLES: Final[Mapping[str, tuple[str, str]]] = {
    "thigh": ("Thigh, hip to knee centre", "Winter 2009, from {}"),
    "shank": ("Shank, knee to ankle centre", "Winter 2009, from {}"),
    "ankle_height": ("Ankle centre above the sole", "Winter 2009, from {}"),
    "foot": ("Foot, heel to toe", "Winter 2009, from body height"),
    "hip_width": ("Between the hip centres", "person's share of body height"),
}
"""Length → title and basis of an estimate, `{}` being the measured leg or the height."""

BY_PELVIS: Final = "Harrington 2007, from the measured pelvis"


@dataclass(frozen=True)
class BodyLength:
    """One length as text, whether it was measured, and its origin."""

    title: str
    value: str
    measured: bool
    source: str


def view_lengths(body: Mapping[str, Any] | None) -> tuple[BodyLength, ...]:
    """View of `body` in analysis.json; empty if no body was constructed."""
    if body is None:
        return ()
    height = body["height_m"]
    leg, rows = body["leg_m"], []
    if height is not None:
        rows.append(BodyLength("Body height", f"{format_number(height, 2)} m", True, "as entered"))
    elif leg is None:
        rows.append(BodyLength("Body height", f"{NOMINAL_HEIGHT_M:.2f} m", False, "none entered"))
    if leg is not None:
        rows.append(BodyLength("Leg, ASIS to ankle", f"{format_number(leg, 3)} m", True, "by tape measure"))
    scaled = "body height" if leg is None else "leg length"
    for name, (title, guess) in TITLES.items():
        length = body["lengths"][name]
        by_tape = BY_PELVIS if name == "hip_width" else "by tape measure"
        source = by_tape if length["measured"] else guess.format(scaled)
        rows.append(BodyLength(title, f"{format_number(length['m'], 3)} m", length["measured"], source))
    return tuple(rows)
