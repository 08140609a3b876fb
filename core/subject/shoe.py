"""The shape of a shoe's sole as a tape measures it: what the clearance of heel and toe is measured on.

It is measured from the sensor: where that sits on the foot is known to a few centimetres only, and a heel
that is 7 cm wrong along the sole is 6 cm wrong in height when the foot leaves the floor.
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
    """The sole seen from the side, the foot flat on the floor; m.

    Parameters
    ----------
    back_m, front_m : along the floor from the middle of the foot's sensor backwards to the sole's rear end
        and forwards to its tip. tip_up_m : how far the tip stands off the floor.

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
