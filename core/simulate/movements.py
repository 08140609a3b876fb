"""The named movements of the command line other than walks: squats, chair and bed, swings and bows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from sagittal.core.errors import ParameterError
from sagittal.core.simulate.chest import ChestSimulation, Day, PostureHold, simulate_day
from sagittal.core.simulate.functional import FunctionalSimulation, SwingsAndBows, simulate_swings_and_bows
from sagittal.core.simulate.patients import PATIENTS
from sagittal.core.simulate.scripts import ON_SKIN
from sagittal.core.simulate.squat import Squats, SquatSimulation, simulate_squats
from sagittal.core.simulate.squat_chain import place_as_agreed
from sagittal.core.simulate.tug import ChairSimulation, simulate_chair_rises, simulate_tug


@dataclass(frozen=True)
class ChairTest:
    """A test that begins on a chair: timed up and go, or five rises; and the person."""

    person: str
    rises: bool = False


@dataclass(frozen=True)
class Movement:
    """A kind of movement: squats, swings and bows, postures of a chest, or a test that begins on a chair.

    Parameters
    ----------
    agreed : sensors attached as specified for the fixed offset (docs/science/squat.md, "Fixed offset"), else
        in random orientation.
    """

    title: str
    does: Squats | SwingsAndBows | Day | ChairTest
    agreed: bool = False


MOVEMENTS: Mapping[str, Movement] = MappingProxyType(
    {
        "squats": Movement(
            "Five squats on the right leg, sensors put on anyhow: no analysis of squats takes them", Squats()
        ),
        "squats_left": Movement(
            "Five squats on the left leg, sensors put on anyhow: no analysis of squats takes them",
            Squats(side="left"),
        ),
        "squats_agreed": Movement(
            "Six squats on the right leg, sensors put on as agreed", Squats(hinged=True, repetitions=6), True
        ),
        "squats_both_legs": Movement(
            "Five squats on each leg, one after the other, sensors put on as agreed",
            Squats(hinged=True, other="lifted"),
            True,
        ),
        "squats_together": Movement(
            "Six squats on both feet, sensors put on as agreed",
            Squats(hinged=True, repetitions=6, valgus_rad=0.0, other="along"),
            True,
        ),
        "swings_and_bows": Movement("Twelve swings of each leg and six bows", SwingsAndBows()),
        "tug": Movement("Timed up and go", ChairTest("healthy")),
        **{
            f"tug_{name}": Movement(f"Timed up and go: {p.title}", ChairTest(name))
            for name, p in PATIENTS.items()
        },
        "five_sit_to_stand": Movement("Five times sit to stand", ChairTest("healthy", rises=True)),
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
) -> SquatSimulation | FunctionalSimulation | ChestSimulation | ChairSimulation:
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
        mounts = place_as_agreed(height_m, does.sides) if MOVEMENTS[name].agreed else None
        return simulate_squats(does, height_m, seed, setup, mounts)
    if isinstance(does, SwingsAndBows):
        return simulate_swings_and_bows(does, height_m, seed, setup)
    if isinstance(does, ChairTest):
        run = simulate_chair_rises if does.rises else simulate_tug
        return run(does.person, seed, height_m, setup)
    return simulate_day(does, height_m, seed, setup)
