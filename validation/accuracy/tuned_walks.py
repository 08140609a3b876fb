"""Simulated walkers with the true orientation of their sensors: what shipped gains are fitted and checked on.

`python -m validation.accuracy.tuned_walks DIR` writes them, one folder per segment, for `sagittal tune`.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Final

import numpy as np

from sagittal.core.frames import FOOT, SHANK, THIGH, Segment, Side
from sagittal.core.fusion.algorithms.benchmark import ReferenceTrial
from sagittal.core.fusion.algorithms.presets import BodyPlace
from sagittal.core.rotation import about, multiply, rotate
from sagittal.core.simulate.mems import MEMS
from sagittal.core.simulate.script import scale_script
from sagittal.core.simulate.scripts import SCRIPTS
from sagittal.core.simulate.simulation import Simulation, simulate

PLACEMENTS: Final[tuple[BodyPlace, ...]] = ("foot", "shank", "thigh", "pelvis")
REST_S: Final = 5.0
"""Every script starts with at least 6 s of standing."""
LEFT_BIAS: Final = np.radians(0.1)
"""Standard deviation per axis, rad/s, of the bias that a rest leaves.

Simulated people stand exactly still, real ones sway by 0.1 to 1 °/s. Integration alone drifts by 0.02 to
0.12 °/s on the recordings of `optical_segments`, and by a third of that on simulated walks without this.
"""


@dataclass(frozen=True)
class Person:
    """Who walks which script, with sensors of what noise, and the leg whose sensors are taken."""

    script: str
    height_m: float
    seed: int
    noise: float
    side: Side

    @property
    def name(self) -> str:
        return f"{self.script}_{self.height_m * 100:.0f}"


FITTED: Final = (
    Person("five_minutes", 1.75, 101, 1.0, "left"),
    Person("slow", 1.58, 102, 2.0, "right"),
    Person("fast_with_turns", 1.83, 103, 1.0, "right"),
    Person("figure_of_eight", 1.66, 104, 0.5, "left"),
    Person("hemiparetic", 1.70, 105, 1.0, "left"),
    Person("drop_foot", 1.62, 106, 2.0, "left"),
    Person("parkinson", 1.78, 107, 1.0, "right"),
    Person("crouch", 1.54, 108, 0.5, "right"),
)
"""People the gains are fitted to."""
CHECKED: Final = (
    Person("five_minutes", 1.60, 201, 2.0, "right"),
    Person("slow", 1.80, 202, 1.0, "left"),
    Person("fast_with_turns", 1.68, 203, 0.5, "left"),
    Person("elderly", 1.64, 204, 1.0, "right"),
    Person("stiff_knee", 1.74, 205, 2.0, "left"),
    Person("antalgic", 1.86, 206, 1.0, "left"),
)
"""Other people, other walks, other sensors."""


@cache
def walk(person: Person) -> Simulation:
    scenario = SCRIPTS[person.script]
    walker = scenario.walker.scaled_to(person.height_m)
    setup = replace(scenario.setup, noise=MEMS.times(person.noise))
    return simulate(scale_script(scenario.script, walker.scale), walker, person.seed, setup)


def trial(person: Person, placement: BodyPlace) -> ReferenceTrial:
    """One sensor of a walk, its reference turned so that y is magnetic north."""
    result = walk(person)
    legs: dict[BodyPlace, Segment] = {
        "foot": FOOT[person.side],
        "shank": SHANK[person.side],
        "thigh": THIGH[person.side],
        "pelvis": "pelvis",
    }
    segment = legs[placement]
    device = next(d for d, segments in result.recording.segments.items() if segments == segment)
    stream = result.recording.streams[device]
    assert stream.acc is not None
    assert stream.gyr is not None
    assert stream.mag is not None
    q = result.sensor_q[segment]
    field = rotate(q[0], result.ideal[segment].mag[0])
    q = multiply(about(2, np.arctan2(field[0], field[1])), q)
    moving = np.arange(len(q)) >= REST_S * stream.rate_hz
    bias = np.random.default_rng((person.seed, PLACEMENTS.index(placement))).normal(0.0, LEFT_BIAS, 3)
    gyr = stream.gyr + np.where(moving[:, None], bias, 0.0)
    return ReferenceTrial(person.name, stream.rate_hz, gyr, stream.acc, stream.mag, q, moving)


def trial_file(result: ReferenceTrial) -> bytes:
    """The trial as an .npz of the BROAD layout."""
    file = BytesIO()
    np.savez(
        file,
        imu_gyr=result.gyr,
        imu_acc=result.acc,
        imu_mag=result.mag,
        opt_quat=result.reference,
        movement=result.moving,
        sampling_rate=np.array(result.rate_hz),
    )
    return file.getvalue()


def main(folder: Path) -> None:
    for placement in PLACEMENTS:
        home = folder / placement
        home.mkdir(parents=True, exist_ok=True)
        for prefix, people in (("fit", FITTED), ("check", CHECKED)):
            for person in people:
                result = trial(person, placement)
                (home / f"{prefix}_{person.name}.npz").write_bytes(trial_file(result))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
