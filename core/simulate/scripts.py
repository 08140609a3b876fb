"""The named scripts for CLI, demo and accuracy tests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi, radians
from types import MappingProxyType
from typing import Final

from sagittal.core.errors import ParameterError
from sagittal.core.frames import Segment
from sagittal.core.simulate.gait.soft_tissue import SoftTissue
from sagittal.core.simulate.impaired import IMPAIRED
from sagittal.core.simulate.mems import MEMS
from sagittal.core.simulate.patients import PATIENTS, QUICKLY, SLOWLY, SimulatedPatient
from sagittal.core.simulate.script import Arc, Pivot, Script, SingleSteps, Stand, Straight, scale_script
from sagittal.core.simulate.setup import Dropout, RecordingSetup
from sagittal.core.simulate.simulation import Simulation, simulate
from sagittal.core.simulate.walker import Walker

ON_SKIN: Final = RecordingSetup(tissue=SoftTissue(), impacts=True)
"""Named scripts are recorded with sensors on skin and the shock of contact: fixed to the bone, without
shocks, they would flatter every analysis."""


REFERENCE_PERSON: Final = Walker()


@dataclass(frozen=True)
class Scenario:
    """A script for a walker of the reference height, the walker, and the recording set-up."""

    title: str
    script: Script
    setup: RecordingSetup = ON_SKIN
    walker: Walker = REFERENCE_PERSON


_COMFORTABLE: Script = (
    Stand(6.0),
    Straight(25.6, 0.64, 0.54),
    Stand(3.0),
    Straight(19.2, 0.64, 0.54),
    Stand(4.0),
)

_LAP: Script = (
    Straight(24.0, 0.64, 0.54),
    Arc(1.5, pi, 0.52, 0.56),
    Straight(18.0, 0.56, 0.58),
    Arc(0.8, -pi, 0.50, 0.56),
    Straight(24.0, 0.67, 0.50),
    Stand(5.0),
    Arc(2.0, -pi, 0.55, 0.55),
    Straight(22.0, 0.64, 0.54),
    Pivot(pi, radians(30.0), 0.55),
)


def _bouts(patient: SimulatedPatient, bout_m: float = 12.0) -> Scenario:
    """Two straight bouts with a stop: the recording used to measure the signatures of simulated patients."""
    bout = Straight(bout_m, patient.step_m, patient.step_s)
    return Scenario(patient.title, (Stand(6.0), bout, Stand(2.0), bout, Stand(4.0)), walker=patient.walker)


def _festination(start: SimulatedPatient, steps: int = 14) -> Scenario:
    """Steps that become shorter and faster, a freeze of 4 s, and the same again
    (docs/science/simulation.md, "Virtual people").
    """
    hurry = SingleSteps(
        tuple((start.step_m * (1 - 0.035 * i), 0.0, start.step_s * (1 - 0.02 * i)) for i in range(steps))
    )
    script = (Stand(6.0), hurry, Stand(4.0), hurry, Stand(4.0))
    return Scenario("Festination and freezing", script, walker=start.walker)


SCRIPTS: Mapping[str, Scenario] = MappingProxyType(
    {
        "comfortable": Scenario("Walk at comfortable speed", _COMFORTABLE),
        "slow": Scenario(
            "Slow walk",
            (Stand(6.0), Straight(14.4, 0.48, 0.73), Stand(3.0), Straight(12.48, 0.48, 0.73), Stand(4.0)),
            walker=SLOWLY,
        ),
        "fast_with_turns": Scenario(
            "Fast walk with turns",
            (
                Stand(6.0),
                Straight(12.0, 0.66, 0.47),
                Arc(1.4, pi, 0.55, 0.53),
                Straight(12.0, 0.66, 0.47),
                Arc(0.8, -pi, 0.50, 0.54),
                Straight(12.0, 0.66, 0.47),
                Arc(1.4, -pi, 0.55, 0.53),
                Straight(8.0, 0.66, 0.47),
                Stand(4.0),
            ),
            walker=QUICKLY,
        ),
        "figure_of_eight": Scenario(
            "Figure of eight",
            (
                Stand(6.0),
                Straight(6.4, 0.64, 0.54),
                Arc(1.6, 2.0 * pi, 0.5, 0.56),
                Arc(1.6, -2.0 * pi, 0.5, 0.56),
                Straight(6.4, 0.64, 0.54),
                Stand(4.0),
            ),
        ),
        "lost_sensor": Scenario(
            "Walk with one sensor lost for ten seconds and noisy sensors",
            _COMFORTABLE,
            replace(
                ON_SKIN,
                noise=MEMS.times(2.0),
                packet_loss=0.01,
                dropouts=(Dropout("shank_r", 18.0, 28.0),),
            ),
        ),
        "five_minutes": Scenario(
            "Five minutes with turns and changes of speed", (Stand(8.0), *_LAP * 3, Stand(5.0))
        ),
        **{name: _bouts(patient) for name, patient in PATIENTS.items()},
        "festination": _festination(PATIENTS["parkinson"]),
    }
)


IMPAIRED_WALKS: Mapping[str, Scenario] = MappingProxyType(
    {name: Scenario(title, script, walker=walker) for name, (title, script, walker) in IMPAIRED.items()}
)
"""Scripts of people who do not walk like the textbook."""


def simulate_scenario(
    name: str,
    seed: int = 0,
    height_m: float = 1.75,
    rate_hz: float = 100.0,
    worn: tuple[Segment, ...] | None = None,
    dropouts: tuple[Dropout, ...] | None = None,
) -> Simulation:
    """Simulate a named script for a person of a height; its lengths scale with the person.

    Parameters
    ----------
    worn, dropouts : sensors, if not all seven; failures, if not those of the script.

    Raises
    ------
    ParameterError : "unknown_script" (the message lists the names), "height_implausible", "rate_range".
    """
    known = {**SCRIPTS, **IMPAIRED_WALKS}
    if name not in known:
        raise ParameterError("unknown_script", f"No script '{name}'; expected one of {', '.join(known)}.")
    scenario = known[name]
    walker = scenario.walker.scaled_to(height_m)
    setup = replace(
        scenario.setup,
        rate_hz=rate_hz,
        worn=scenario.setup.worn if worn is None else worn,
        dropouts=scenario.setup.dropouts if dropouts is None else dropouts,
    )
    return simulate(scale_script(scenario.script, walker.scale), walker, seed, setup)
