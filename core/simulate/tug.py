"""Timed up and go, and rises from a chair, with sensors on pelvis, legs and chest
(docs/science/simulation.md, "Timed up and go").

The walker rises, walks out, turns on the spot, walks back, turns and sits down. The ground truth includes the
transitions of the script and, separately, the segments of the test as derived from the exact motion of the
trunk.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, radians, sqrt
from typing import Final

import numpy as np
from scipy.ndimage import uniform_filter1d

from sagittal.core.errors import ParameterError
from sagittal.core.frames import Floats, Segment
from sagittal.core.rotation import about, multiply, rotate
from sagittal.core.simulate.chest import CHANGE_S, POSTURES
from sagittal.core.simulate.gait.chair import ChairChange, sit_and_rise
from sagittal.core.simulate.gait.human import Motion, move
from sagittal.core.simulate.gait.impacts import draw_impacts
from sagittal.core.simulate.gait.stance import Q_NEUTRAL
from sagittal.core.simulate.patients import PATIENTS
from sagittal.core.simulate.phases import Phase
from sagittal.core.simulate.recorder import Draws, Recorded, oversampling, record
from sagittal.core.simulate.script import Item, Pivot, Stand, Straight, plan
from sagittal.core.simulate.sensors import PLACES, Mount, SensorPath, draw_mounts, place_sensor
from sagittal.core.simulate.setup import RecordingSetup
from sagittal.core.simulate.spline import sign_continuous

WALK_M: Final = 3.0
"""Way to the mark (Podsiadlo and Richardson 1991)."""

TURN_STEP: Final = radians(45.0)
"""Turn of one step of a person who walks at `USUAL_MPS`; slower people turn less with each (our choice)."""

USUAL_MPS: Final = 1.19
SLOWEST: Final = 0.4
"""Least share of `USUAL_MPS` that slows rising and turning (our choice)."""

PAUSE_S: Final = 0.3
"""Standing between rising and the first step, and between the last step and sitting down."""

STERNUM_M: Final = 0.42
"""Breastbone above the hips of the reference person, along the trunk."""

EDGE: Final = 0.1
"""Share of its greatest rate at which the trunk's lean begins and ends a change of posture
(docs/science/timed-tests.md, "Rising and sitting down")."""


@dataclass(frozen=True, eq=False)
class ChairTruth:
    """Exact ground truth at the samples of the recording.

    Parameters
    ----------
    t_s : (n,). chest_rad : (n,) forward lean of the trunk. height_m : (n,) of the hips.
    heading_rad : (n,) of the path.
    scripted : rises and sitting down as requested. changes : the same from the start to the end of the lean.
        segments : of a timed up and go, else empty.
    contacts_s : initial contacts of both feet.
    """

    t_s: Floats
    rate_hz: float
    chest_rad: Floats
    height_m: Floats
    heading_rad: Floats
    scripted: tuple[Phase, ...]
    changes: tuple[Phase, ...]
    segments: tuple[Phase, ...]
    contacts_s: tuple[float, ...]
    mounts: Mapping[Segment, Mount]

    @property
    def duration_s(self) -> float:
        """From the start of the first lean to the end of the last."""
        return self.changes[-1].end_s - self.changes[0].start_s


@dataclass(frozen=True, eq=False)
class ChairSimulation(Recorded):
    """A recording of a test that begins on a chair, with its ground truth."""

    truth: ChairTruth


def simulate_tug(
    patient: str = "healthy",
    seed: int = 0,
    height_m: float = 1.75,
    setup: RecordingSetup | None = None,
    sit_s: float = 4.0,
    walk_m: float = WALK_M,
    left: bool = True,
) -> ChairSimulation:
    """Simulate a timed up and go test.

    Parameters
    ----------
    sit_s : quiet sitting before and after. left : direction of both turns.

    Raises
    ------
    ParameterError : "unknown_script", "height_implausible".
    """
    if patient not in PATIENTS:
        raise ParameterError(
            "unknown_script", f"No person '{patient}'; expected one of {', '.join(PATIENTS)}."
        )
    person = PATIENTS[patient]
    share = min(1.0, max(SLOWEST, person.step_m / person.step_s / USUAL_MPS))
    change_s, angle = CHANGE_S / sqrt(share), pi if left else -pi
    k = person.walker.scaled_to(height_m).scale
    out = Straight(walk_m, k * person.step_m, person.step_s)
    turn = Pivot(angle, TURN_STEP * sqrt(share), person.step_s)
    script = (Stand(sit_s + change_s + PAUSE_S), out, turn, out, turn, Stand(PAUSE_S + change_s + sit_s))
    return _simulate(script, patient, seed, height_m, setup, sit_s, change_s, 1)


def simulate_chair_rises(
    patient: str = "healthy",
    seed: int = 0,
    height_m: float = 1.75,
    setup: RecordingSetup | None = None,
    repetitions: int = 5,
    sit_s: float = 4.0,
    pause_s: float = PAUSE_S,
) -> ChairSimulation:
    """Simulate repeated rising and sitting down; `pause_s` is spent in every posture.

    Raises
    ------
    ParameterError : as `simulate_tug`, "chair_rises" for no repetition.
    """
    if patient not in PATIENTS:
        raise ParameterError(
            "unknown_script", f"No person '{patient}'; expected one of {', '.join(PATIENTS)}."
        )
    if repetitions < 1:
        raise ParameterError("chair_rises", f"{repetitions} rises; expected at least one.")
    person = PATIENTS[patient]
    share = min(1.0, max(SLOWEST, person.step_m / person.step_s / USUAL_MPS))
    change_s = CHANGE_S / sqrt(share)
    total = 2.0 * sit_s + repetitions * 2.0 * change_s + (2 * repetitions - 1) * pause_s
    return _simulate((Stand(total),), patient, seed, height_m, setup, sit_s, change_s, repetitions, pause_s)


def _simulate(
    script: tuple[Item, ...],
    patient: str,
    seed: int,
    height_m: float,
    setup: RecordingSetup | None,
    sit_s: float,
    change_s: float,
    rises: int,
    pause_s: float = PAUSE_S,
) -> ChairSimulation:
    setup, draws = setup or RecordingSetup(), Draws(seed)
    walker = PATIENTS[patient].walker.scaled_to(height_m)
    every = oversampling(setup.rate_hz)
    planned = plan(script, walker, draws.steps)
    if planned.steps:
        down = planned.stands[-1][0] + PAUSE_S
        starts = [("sit_to_stand", sit_s), ("stand_to_sit", down)]
    else:
        kinds = ("sit_to_stand", "stand_to_sit")
        starts = [(kinds[i % 2], sit_s + i * (change_s + pause_s)) for i in range(2 * rises)]
    chair = tuple(ChairChange(kind, from_s, from_s + change_s) for kind, from_s in starts)  # type: ignore[arg-type]
    motion = move(planned, walker, every * setup.rate_hz, chair)
    impacts = draw_impacts(motion, draws.impacts) if setup.impacts else ()

    mounts = draw_mounts(PLACES, walker.scale, setup.mount_spread_rad, draws.mounts)
    chest = draw_mounts({"chest": (0.0, 0.0, 0.0)}, walker.scale, setup.mount_spread_rad, draws.mounts)
    paths = {s: place_sensor(motion, s, mount, setup.tissue, impacts) for s, mount in mounts.items()}
    lean = POSTURES["stand"].pitch_rad + sit_and_rise(motion.t_s, chair).chest_rad
    paths["chest"] = _chest_path(motion, lean, STERNUM_M * walker.scale, chest["chest"])
    recorded = record(paths, setup, draws, height_m, protocol="tug" if planned.steps else "five_sit_to_stand")

    changes = tuple(_see_change(motion.t_s, lean, change) for change in chair)
    truth = ChairTruth(
        t_s=motion.t_s[::every],
        rate_hz=setup.rate_hz,
        chest_rad=lean[::every],
        height_m=motion.p["pelvis"][::every, 2],
        heading_rad=motion.heading_rad[::every],
        scripted=tuple(Phase(c.kind, c.start_s, c.end_s) for c in chair),
        changes=changes,
        segments=_segments(motion, changes) if planned.steps else (),
        contacts_s=tuple(step.time_s for step in planned.steps),
        mounts=mounts | chest,
    )
    return ChairSimulation(**vars(recorded), truth=truth)


def _chest_path(motion: Motion, lean: Floats, above_m: float, mount: Mount) -> SensorPath:
    """Path of a sensor on a trunk attached to the pelvis, facing along the path, with its own forward
    lean.
    """
    q = multiply(multiply(about(2, motion.heading_rad), Q_NEUTRAL), about(2, -lean))
    place = np.array([0.0, above_m, 0.0]) + mount.position_m
    p = motion.p["pelvis"] + rotate(q, place)
    return SensorPath(motion.t_s, p, sign_continuous(multiply(q, mount.q_segment_sensor)))


def _see_change(t: Floats, lean: Floats, change: ChairChange) -> Phase:
    """The transition from where the trunk lean rate exceeds `EDGE` of its maximum to where it falls below."""
    inside = (t >= change.start_s) & (t <= change.end_s)
    rate = np.where(inside, np.gradient(lean, t), 0.0)
    forward, back = np.flatnonzero(rate > EDGE * rate.max()), np.flatnonzero(rate < EDGE * rate.min())
    return Phase(change.kind, float(t[forward[0]]), float(t[back[-1]]))


def _segments(motion: Motion, changes: tuple[Phase, ...]) -> tuple[Phase, ...]:
    """The five segments; a turn lasts while its rate exceeds half of its typical value.

    People turn step by step: the rate is averaged over a step.
    """
    rise, down = changes
    step = max(1, round(motion.plan.typical_step_s * motion.rate_hz))
    rate = uniform_filter1d(np.abs(np.gradient(motion.heading_rad, motion.t_s)), step)
    turned = np.abs(motion.heading_rad)
    turns = []
    halves = np.flatnonzero(turned >= 0.5 * pi)[0], np.flatnonzero(turned >= 1.5 * pi)[0]
    middle = sum(halves) // 2
    for part in (slice(None, middle), slice(middle, None)):
        own = np.zeros(len(rate))
        own[part] = rate[part]
        turning_samples = np.flatnonzero(own > 0.5 * (own**2).sum() / own.sum())
        turns.append((float(motion.t_s[turning_samples[0]]), float(motion.t_s[turning_samples[-1]])))
    (a, b), (c, d) = turns
    return (
        rise,
        Phase("walk_out", rise.end_s, a),
        Phase("turn", a, b),
        Phase("walk_back", b, c),
        Phase("turn_to_sit", c, down.end_s),
        Phase("final_turn", c, d),
        down,
    )


__all__ = ["ChairSimulation", "ChairTruth", "simulate_chair_rises", "simulate_tug"]
