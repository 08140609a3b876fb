"""The shape of a shoe's sole as a tape measures it: what the clearance of heel and toe is measured on."""

from __future__ import annotations

from dataclasses import dataclass

from core.errors import ParameterError


@dataclass(frozen=True)
class Shoe:
    """The sole seen from the side, in m from the middle of the ankle, the foot flat on the floor.

    Parameters
    ----------
    back_m, front_m : backwards to its rear end (0.01 to 0.2 m) and forwards to its tip (0.05 to 0.35 m),
        along the floor. tip_up_m : how far the tip stands off the floor, 0 to 0.1 m.

    Raises
    ------
    ParameterError `shoe_implausible`.
    """

    back_m: float
    front_m: float
    tip_up_m: float = 0.0

    def __post_init__(self) -> None:
        limits = {"back_m": (0.01, 0.2), "front_m": (0.05, 0.35), "tip_up_m": (0.0, 0.1)}
        for name, (low, high) in limits.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise ParameterError(
                    "shoe_implausible",
                    f"{name} {value:g} m is outside {low:g} to {high:g} m; give the distance from the middle "
                    "of the ankle in metres.",
                )
