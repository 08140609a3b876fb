"""The named movements of the command line that are not walks: squats on one leg, chair and bed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from core.errors import ParameterError
from core.simulate.chest import ChestSimulation, Day, PostureHold, simulate_day
from core.simulate.scripts import ON_SKIN
from core.simulate.squat import Squats, SquatSimulation, simulate_squats


@dataclass(frozen=True)
class Movement:
    """What is done: squats, or postures with a sensor on the chest."""

    title: str
    does: Squats | Day


MOVEMENTS: Mapping[str, Movement] = MappingProxyType(
    {
        "squats": Movement("Five squats on the right leg", Squats()),
        "squats_left": Movement("Five squats on the left leg", Squats(side="left")),
        "chair_rises": Movement(
            "Five rises from a chair",
            (
                PostureHold("sit", 5.0),
                *(PostureHold("stand", 1.0), PostureHold("sit", 1.0)) * 4,
                PostureHold("stand", 1.0),
                PostureHold("sit", 4.0),
            ),
        ),
        "postures": Movement(
            "Sitting, standing, walking and lying",
            (
                PostureHold("stand", 8.0),
                PostureHold("sit", 5.0),
                PostureHold("stand", 3.0),
                PostureHold("walk", 8.0, 110.0),
                PostureHold("stand", 2.0),
                PostureHold("sit", 4.0),
                PostureHold("lie", 6.0),
                PostureHold("sit", 3.0),
                PostureHold("stand", 3.0),
            ),
        ),
    }
)


def simulate_movement(
    name: str, seed: int = 0, height_m: float = 1.75, rate_hz: float = 100.0
) -> SquatSimulation | ChestSimulation:
    """Simulate a named movement for a person of a height.

    Raises
    ------
    ParameterError : "unknown_script" (the message lists the names), "height_implausible", "rate_range".
    """
    if name not in MOVEMENTS:
        raise ParameterError(
            "unknown_script", f"No movement '{name}'; expected one of {', '.join(MOVEMENTS)}."
        )
    does, setup = MOVEMENTS[name].does, replace(ON_SKIN, rate_hz=rate_hz)
    if isinstance(does, Squats):
        return simulate_squats(does, height_m, seed, setup)
    return simulate_day(does, height_m, seed, setup)
