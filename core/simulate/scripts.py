"""The named scripts of CLI, demo and accuracy tests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi, radians
from types import MappingProxyType
from typing import Final

from core.errors import ParameterError
from core.simulate.recorder import Dropout, Setup, Simulation, simulate
from core.simulate.script import Arc, Pivot, Script, Stand, Straight, scaled
from core.simulate.sensors import MEMS
from core.simulate.soft_tissue import SoftTissue
from core.simulate.walker import Walker

ON_SKIN: Final = Setup(tissue=SoftTissue())
"""Named scripts are recorded with sensors on skin: fixed to the bone they would flatter every analysis."""


@dataclass(frozen=True)
class Scenario:
    """A script, written for the reference person, and how it is recorded."""

    title: str
    script: Script
    setup: Setup = ON_SKIN


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

SCRIPTS: Mapping[str, Scenario] = MappingProxyType(
    {
        "comfortable": Scenario("Walk at comfortable speed", _COMFORTABLE),
        "slow": Scenario(
            "Slow walk",
            (Stand(6.0), Straight(14.4, 0.45, 0.68), Stand(3.0), Straight(12.6, 0.45, 0.68), Stand(4.0)),
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
    }
)


def simulate_scenario(name: str, seed: int = 0, height_m: float = 1.75, rate_hz: float = 100.0) -> Simulation:
    """Simulate a named script for a person of a height; its lengths grow with the person.

    Raises
    ------
    ParameterError : "unknown_script" (the message lists the names), "height_implausible", "rate_range".
    """
    if name not in SCRIPTS:
        raise ParameterError("unknown_script", f"No script '{name}'; expected one of {', '.join(SCRIPTS)}.")
    scenario, walker = SCRIPTS[name], Walker.of_height(height_m)
    setup = replace(scenario.setup, rate_hz=rate_hz)
    return simulate(scaled(scenario.script, walker.scale), walker, seed, setup)
