"""View of sensor and joint positions estimated from motion, compared with nominal positions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from sagittal.core.message import Message
from sagittal.server.report.words.wording import format_number, place_words

OFF_SD: Final = 2.0
"""Deviations from the nominal position above this number of standard deviations are reported."""

AXES: Final = ("forward", "up", "outward")


@dataclass(frozen=True)
class PlaceRow:
    """One sensor, or one joint in the axes of its proximal segment.

    Parameters
    ----------
    values : along `AXES` in cm with their uncertainty, as text. measured : estimated from motion.
    nominal : nominal position, as text. off : significant deviation; otherwise empty.
    """

    title: str
    values: tuple[str, str, str]
    measured: bool
    nominal: str
    off: str


@dataclass(frozen=True)
class KneeAxisRow:
    """Hinge axis of one knee relative to thigh and shank, with uncertainties, as text."""

    title: str
    thigh: str
    shank: str


@dataclass(frozen=True)
class SensorPlaces:
    """Content of the page."""

    sensors: tuple[PlaceRow, ...]
    joints: tuple[PlaceRow, ...]
    knees: tuple[KneeAxisRow, ...]


JOINTS: Final = {
    ("left", "hip"): "Left hip",
    ("left", "knee"): "Left knee",
    ("left", "ankle"): "Left ankle",
    ("right", "hip"): "Right hip",
    ("right", "knee"): "Right knee",
    ("right", "ankle"): "Right ankle",
}
"""Side and joint → label."""


def view_sensor_places(stored: Mapping[str, Any] | None) -> SensorPlaces | None:
    """View of `sensor_places` in analysis.json; None if not estimated from motion."""
    if stored is None:
        return None
    return SensorPlaces(
        sensors=tuple(
            _view_place(place_words(s).capitalize(), s.endswith("_l"), x, x["measured"])
            for s, x in stored["sensors"].items()
        ),
        joints=tuple(
            _view_place(
                Message(
                    "{joint}, in the {place_words}",
                    joint=JOINTS[x["side"], x["joint"]],
                    place_words=place_words(x["segment"]),
                ),
                x["side"] == "left",
                x,
                [x["measured"]] * len(AXES),
            )
            for x in stored["joints"].values()
        ),
        knees=tuple(
            KneeAxisRow(
                Message("{side} knee", side=side).capitalize(),
                _write_turn(x["thigh_deg"], x["thigh_sd_deg"]),
                _write_turn(x["shank_deg"], x["shank_sd_deg"]),
            )
            for side, x in stored["knees"].items()
        ),
    )


def _view_place(title: str, left: bool, stored: Mapping[str, Any], measured: Sequence[bool]) -> PlaceRow:
    # lateral is to the left on the left side
    out = (1.0, 1.0, -1.0 if left else 1.0)
    estimate, guess = ([a * b for a, b in zip(stored[k], out, strict=True)] for k in ("cm", "guess_cm"))
    spread = stored["sd_cm"]
    a, b, c = (
        f"{format_number(x, 1)} ± {format_number(sd, 1)}" for x, sd in zip(estimate, spread, strict=True)
    )
    off = [
        f"{format_number(abs(x - y), 1)} cm {axis if x > y else OPPOSITE[axis]}"
        for axis, x, y, sd, heard in zip(AXES, estimate, guess, spread, measured, strict=True)
        if heard and abs(x - y) > OFF_SD * sd
    ]
    nominal = ", ".join(format_number(x, 1) for x in guess)
    return PlaceRow(title, (a, b, c), any(measured), nominal, ", ".join(off))


OPPOSITE: Final[Mapping[str, str]] = {"forward": "back", "up": "down", "outward": "inward"}


def _write_turn(degrees: float, sd: float) -> str:
    return f"{format_number(degrees, 0)}° ± {format_number(sd, 0)}°"
