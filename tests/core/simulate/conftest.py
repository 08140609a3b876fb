"""Simulations shared by the tests of this folder; each takes about half a second."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sagittal.core.simulate import (
    STEADY,
    Arc,
    Pivot,
    RecordingSetup,
    Simulation,
    Stand,
    Straight,
    Walker,
    simulate,
    simulate_scenario,
)
from sagittal.core.simulate.gait.human import Motion, move
from sagittal.core.simulate.script import plan

MIXED = (
    Stand(4.0),
    Straight(6.0, 0.62, 0.55),
    Pivot(np.pi, 0.7, 0.55),
    Straight(4.0, 0.55, 0.58),
    Stand(2.0),
    Arc(1.6, 2.0 * np.pi, 0.5, 0.56),
    Arc(1.6, -2.0 * np.pi, 0.5, 0.56),
    Stand(3.0),
)
"""Straight, pivot, stop and two arcs (docs/science/simulation.md, "Limits on construction")."""


@pytest.fixture(scope="session")
def comfortable() -> Simulation:
    return simulate_scenario("comfortable", seed=1)


@pytest.fixture(scope="session")
def mixed() -> Simulation:
    """No noise, so that signals can be compared with truth."""
    return simulate(MIXED, seed=2, setup=RecordingSetup(noise=None))


@pytest.fixture(scope="session")
def steady_motion() -> Motion:
    """Forty equal steps of the reference person at the speed the curves were fitted for."""
    walker = Walker(variability=STEADY)
    script = (Stand(5.0), Straight(40 * 0.64, 0.64, 0.54), Stand(3.0))
    return move(plan(script, walker, np.random.default_rng(0)), walker, 400.0)


@pytest.fixture(scope="session")
def move_steadily() -> Callable[[float, float], Motion]:
    """Six equal steps on a grid of a given rate by a person of a given height."""

    def run(rate_hz: float, height_m: float) -> Motion:
        walker = Walker.of_height(height_m, variability=STEADY)
        k = walker.scale
        script = (Stand(2.0), Straight(6 * 0.64 * k, 0.64 * k, 0.54), Stand(2.0))
        return move(plan(script, walker, np.random.default_rng(0)), walker, rate_hz)

    return run
