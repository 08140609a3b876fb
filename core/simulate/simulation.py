"""From a script to a recording with ground truth: the entry point of the walking simulator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sagittal.core.frames import Segment
from sagittal.core.simulate.gait.human import move
from sagittal.core.simulate.gait.impacts import draw_impacts
from sagittal.core.simulate.recorder import Draws, Recorded, oversampling, record
from sagittal.core.simulate.script import Script, plan
from sagittal.core.simulate.sensors import PLACES, draw_mounts, place_sensor
from sagittal.core.simulate.setup import RecordingSetup
from sagittal.core.simulate.truth import WalkTruth, truth_of
from sagittal.core.simulate.walker import Walker


@dataclass(frozen=True, eq=False)
class Simulation(Recorded):
    """A simulated recording of a walk with its ground truth."""

    truth: WalkTruth

    def peaks(self) -> dict[Segment, tuple[float, float]]:
        """Segment → largest |specific force| in m/s² and |angular rate| in rad/s of the ideal signals."""
        return {
            segment: (
                float(np.linalg.norm(s.acc, axis=1).max()),
                float(np.linalg.norm(s.gyr, axis=1).max()),
            )
            for segment, s in self.ideal.items()
        }


def simulate(
    script: Script, walker: Walker | None = None, seed: int = 0, setup: RecordingSetup | None = None
) -> Simulation:
    """Simulate a walker following a script with seven sensors; equal arguments give bit-identical results.

    Parameters
    ----------
    script : starts and ends with standing. walker : default is the healthy reference person.
    seed : of all random numbers, see `Draws`.

    Raises
    ------
    ParameterError : "script_standing", "script_item", "step_too_long".
    """
    walker, setup, draws = walker or Walker(), setup or RecordingSetup(), Draws(seed)
    every = oversampling(setup.rate_hz)
    motion = move(plan(script, walker, draws.steps), walker, every * setup.rate_hz)
    mounts = draw_mounts(PLACES, walker.scale, setup.mount_spread_rad, draws.mounts)
    impacts = draw_impacts(motion, draws.impacts) if setup.impacts else ()
    paths = {s: place_sensor(motion, s, mount, setup.tissue, impacts) for s, mount in mounts.items()}
    recorded = record(paths, setup, draws, walker.height_m)
    truth = truth_of(motion, every, mounts, recorded.errors, seed)
    return Simulation(**vars(recorded), truth=truth)
