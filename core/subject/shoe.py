"""Tape-measured shape of a shoe sole, the reference for heel and toe clearance.

Distances are measured from the sensor: its position on the foot is otherwise known only to a few centimetres,
and a heel displaced by 7 cm along the sole is 6 cm wrong in height at toe-off.
"""

from __future__ import annotations

from dataclasses import dataclass

from sagittal.core.errors import ParameterError
from sagittal.core.message import Message

LIMITS = {"back_m": (0.0, 0.35), "front_m": (0.0, 0.35), "tip_up_m": (0.0, 0.1)}
"""What a tape can read, m."""

LENGTHS = (0.1, 0.4)
"""Of a whole sole, m."""


@dataclass(frozen=True)
class Shoe:
    """Side view of the sole with the foot flat on the floor; m.

    Parameters
    ----------
    back_m, front_m : horizontal distances from the centre of the foot sensor back to the rear end of the sole
    and forward to its tip. tip_up_m : height of the tip above the floor.

    Raises
    ------
    ParameterError `shoe_implausible`.
    """

    back_m: float
    front_m: float
    tip_up_m: float = 0.0

    def __post_init__(self) -> None:
        values = {name: (getattr(self, name), limits) for name, limits in LIMITS.items()}
        values["back_m + front_m"] = (self.back_m + self.front_m, LENGTHS)
        for name, (value, (low, high)) in values.items():
            if not low <= value <= high:
                raise ParameterError(
                    "shoe_implausible",
                    Message(
                        "{name} {value:g} m is outside {low:g} to {high:g} m; give distances along the sole "
                        "from the middle of the foot's sensor, in metres.",
                        name=name,
                        value=value,
                        low=low,
                        high=high,
                    ),
                )
