"""Trials whose sensors have hardly any sample, or none, in common: drawn from a seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final, get_args

import numpy as np

from sagittal.core.body.pose_params import PoseParams
from sagittal.core.estimators import Requested
from sagittal.core.frames import Bools, Floats, Protocol, Segment
from sagittal.core.pipeline import PipelineConfig
from sagittal.core.pipeline.config import Detector
from sagittal.core.signals.recording import ImuStream, Recording, Subject
from sagittal.core.signals.rest import find_runs
from sagittal.core.simulate import (
    RecordingSetup,
    Walker,
    simulate,
    simulate_chair_rises,
    simulate_day,
    simulate_movement,
    simulate_sway,
    simulate_tug,
)
from sagittal.core.simulate.chest import PostureHold
from sagittal.core.simulate.script import Stand, Straight
from sagittal.core.squat.params import SquatParams
from tests.helpers.kept import keep

LEGS: Final[tuple[Segment, ...]] = ("thigh_l", "thigh_r", "shank_l", "shank_r", "foot_l", "foot_r")
FEET: Final[tuple[Segment, ...]] = ("foot_l", "foot_r")
WALKS: Final[Mapping[str, tuple[Segment, ...]]] = {
    "seven": ("pelvis", *LEGS),
    "legs": LEGS,
    "feet_and_pelvis": (*FEET, "pelvis"),
    "feet": FEET,
    "one_foot": ("foot_r",),
    "lower_back": ("pelvis",),
    "shanks": ("shank_l", "shank_r"),
    "thighs_and_pelvis": ("thigh_l", "thigh_r", "pelvis"),
    "left_leg": ("pelvis", "thigh_l", "shank_l", "foot_l"),
}
PROTOCOLS_OF_WALKS: Final[tuple[Protocol, ...]] = (
    "walk",
    "walk",
    "walk",
    "treadmill",
    "walk_10m",
    "walk_6min",
)


@keep
def walk() -> Recording:
    """Twenty seconds with all seven sensors, two bouts between quiet standing."""
    script = (Stand(4.0), Straight(7.7, 0.64, 0.54), Stand(2.0), Straight(5.1, 0.64, 0.54), Stand(3.0))
    return simulate(script, Walker(), 0).recording


@keep
def _with_chest() -> Recording:
    return simulate_tug(sit_s=3.0).recording


@keep
def _chair_rises() -> Recording:
    return simulate_chair_rises(sit_s=3.0).recording


@keep
def _sway() -> Recording:
    return simulate_sway().recording


@keep
def _squats(name: str) -> Recording:
    return simulate_movement(name, 0).recording


@keep
def _daily_life() -> Recording:
    day = (
        PostureHold("stand", 6.0),
        *(PostureHold("sit", 4.0), PostureHold("stand", 4.0)) * 3,
        PostureHold("walk", 12.0),
        PostureHold("lie", 8.0),
        PostureHold("sit", 4.0),
        PostureHold("stand", 5.0),
    )
    return replace(simulate_day(day, setup=RecordingSetup(rate_hz=50.0)).recording, protocol="activity")


def keep_segments(recording: Recording, segments: tuple[Segment, ...]) -> Recording:
    """The same trial with sensors on these segments alone."""
    retained = {d: s for d, s in recording.segments.items() if s in segments}
    return replace(recording, streams={d: recording.streams[d] for d in retained}, segments=retained)


def draw_whole_trial(rng: np.random.Generator) -> tuple[str, Recording]:
    """Draw a trial of any protocol, nothing of it lost yet, and its name."""
    kind = str(rng.choice(["walk"] * 8 + ["chest", "squat", "squat", "trunk", "standing", "activity"]))
    if kind == "walk":
        text = str(rng.choice(list(WALKS)))
        protocol = PROTOCOLS_OF_WALKS[int(rng.integers(len(PROTOCOLS_OF_WALKS)))]
        result = keep_segments(walk(), WALKS[text])
        belt = 1.2 if protocol == "treadmill" and rng.random() < 0.5 else None
        return f"{protocol} with {text}", replace(result, protocol=protocol, belt_speed_mps=belt)
    if kind == "chest":
        worn_by: tuple[tuple[Segment, ...], ...] = (("chest",), ("chest", "pelvis"), ("chest", *FEET))
        worn_on = worn_by[int(rng.integers(3))]
        return f"walk with {worn_on}", replace(keep_segments(_with_chest(), worn_on), protocol="walk")
    if kind == "squat":
        name = str(rng.choice(["squats_agreed", "squats_both_legs", "squats_together"]))
        return name, _squats(name)
    if kind == "trunk":
        result = _with_chest() if rng.random() < 0.5 else _chair_rises()
        trunk: tuple[Segment, ...] = ("pelvis", "chest") if rng.random() < 0.5 else ("pelvis",)
        return f"{result.protocol} with {trunk}", keep_segments(result, trunk)
    if kind == "standing":
        eyes: Protocol = "standing_eyes_open" if rng.random() < 0.5 else "standing_eyes_closed"
        return eyes, replace(_sway(), protocol=eyes)
    return "daily life", _daily_life()


Pattern = Callable[[np.random.Generator, int, int, int], Bools]
"""(draws, samples n, which sensor it is, how many there are) → (n,) samples that are kept."""


def _own_turn(rng: np.random.Generator, n: int, k: int, sensors: int) -> Bools:
    stored_buffer = np.zeros(n, np.bool_)
    stored_buffer[k * n // sensors : (k + 1) * n // sensors] = True
    return stored_buffer


def _alternate(rng: np.random.Generator, n: int, k: int, sensors: int) -> Bools:
    length = int(rng.choice([1, 7, 30, 150]))
    return np.asarray((np.arange(n) // length) % max(2, sensors) == k)


def _nothing(rng: np.random.Generator, n: int, k: int, sensors: int) -> Bools:
    return np.zeros(n, np.bool_)


def _few(rng: np.random.Generator, n: int, k: int, sensors: int) -> Bools:
    stored_buffer = np.zeros(n, np.bool_)
    stored_buffer[rng.choice(n, min(n, int(rng.choice([1, 2, 3, 10]))), replace=False)] = True
    return stored_buffer


def _short_stretch(rng: np.random.Generator, n: int, k: int, sensors: int) -> Bools:
    stored_buffer = np.zeros(n, np.bool_)
    start = int(rng.integers(n))
    stored_buffer[start : start + int(rng.choice([2, 20, 120, 400]))] = True
    return stored_buffer


def _bursts(rng: np.random.Generator, n: int, k: int, sensors: int) -> Bools:
    return np.repeat(rng.random(n // 25 + 1) < rng.choice([0.1, 0.5, 0.9]), 25)[:n]


def _start(rng: np.random.Generator, n: int, k: int, sensors: int) -> Bools:
    return np.asarray(np.arange(n) < n * rng.choice([0.02, 0.2, 0.5]))


def _end(rng: np.random.Generator, n: int, k: int, sensors: int) -> Bools:
    return _start(rng, n, k, sensors)[::-1].copy()


def _single_samples(rng: np.random.Generator, n: int, k: int, sensors: int) -> Bools:
    return np.asarray(np.arange(n) % 20 == 0)


def _halves(rng: np.random.Generator, n: int, k: int, sensors: int) -> Bools:
    first = np.arange(n) < n * rng.choice([0.5, 0.501, 0.52, 0.6])
    return np.asarray(first if k % 2 else first[::-1])


def _all_but_start(rng: np.random.Generator, n: int, k: int, sensors: int) -> Bools:
    return np.asarray(np.arange(n) >= n * rng.choice([0.1, 0.2, 0.45]))


def _all_but_a_stretch(rng: np.random.Generator, n: int, k: int, sensors: int) -> Bools:
    start, length = rng.random(), rng.choice([0.02, 0.1, 0.4])
    share = np.arange(n) / n
    return np.asarray((share < start) | (share > start + length))


PATTERNS: Final[tuple[Pattern, ...]] = (
    _own_turn, _alternate, _few, _short_stretch, _bursts, _start, _end, _single_samples,
    _halves, _halves, _nothing, _all_but_start, _all_but_a_stretch,
)  # fmt: skip


def lose_samples(stream: ImuStream, retained: Bools, how: str) -> ImuStream:
    """One sensor with samples lost.

    Parameters
    ----------
    how : "missing" rows are not there, "acc", "gyr" or "both" are NaN, "frozen" rows repeat the last one,
        "zero" rows hold zeros.
    """
    acc, gyr, gone = stream.acc.copy(), None if stream.gyr is None else stream.gyr.copy(), ~retained
    if how == "missing" and retained.any():
        mag, quat = (None if x is None else x[retained] for x in (stream.mag, stream.quat))
        gyr = None if gyr is None else gyr[retained]
        return replace(stream, t_s=stream.t_s[retained], acc=acc[retained], gyr=gyr, mag=mag, quat=quat)
    if how == "frozen":
        for start, stop in find_runs(gone):
            index = max(start - 1, 0)
            acc[start:stop] = acc[index]
            if gyr is not None:
                gyr[start:stop] = gyr[index]
    if how == "zero":
        acc[gone] = 0.0
        gyr = None if gyr is None else np.where(gone[:, None], 0.0, gyr)
    if how in ("acc", "both"):
        acc[gone] = np.nan
    if how in ("gyr", "both") and gyr is not None:
        gyr[gone] = np.nan
    return replace(stream, acc=acc, gyr=gyr)


def leap(stream: ImuStream, rng: np.random.Generator) -> ImuStream:
    """One sensor all of whose times from some sample on, or of a single packet, are later than they were."""
    n, by_key = len(stream.t_s), float(rng.choice([0.3, 4.0, 60.0, 512.0]))
    t_s: Floats = stream.t_s.copy()
    t_s[int(rng.integers(n)) :] += by_key
    return replace(stream, t_s=t_s)


@dataclass(frozen=True)
class LossyTrial:
    """Analysed input and options. name : description for failure messages."""

    name: str
    recording: Recording
    config: PipelineConfig
    resumable: bool


def draw_trial(seed: int) -> LossyTrial:
    """Draw a trial in which one, several or all sensors lose samples; the same for the same seed."""
    rng = np.random.default_rng(seed)
    name, recording = draw_whole_trial(rng)
    devices = list(recording.streams)
    hit = [d for d in devices if rng.random() < rng.choice([0.3, 0.7, 1.0])] or [str(rng.choice(devices))]
    together = rng.random() < 0.4
    pattern, loss = PATTERNS[int(rng.integers(len(PATTERNS)))], _draw_loss(rng)
    streams = dict(recording.streams)
    message = []
    for k, device in enumerate(hit):
        if not together:
            pattern, loss = PATTERNS[int(rng.integers(len(PATTERNS)))], _draw_loss(rng)
        if loss == "leap":
            streams[device] = leap(streams[device], rng)
        else:
            retained = pattern(rng, len(streams[device].t_s), k, len(hit))
            streams[device] = lose_samples(streams[device], retained, loss)
        message.append(f"{recording.segments.get(device)}: {loss}, {pattern.__name__}")
    height = None if rng.random() < 0.3 else 1.75
    recording = replace(recording, streams=streams, subject=Subject(height))
    estimator: Requested = "auto"
    if rng.random() < 0.3:
        estimator = get_args(Requested)[int(rng.integers(len(get_args(Requested))))]
    detector: Detector = "foot_contact"
    if rng.random() < 0.3:
        detector = get_args(Detector)[int(rng.integers(3))]
    squat = SquatParams(mounting="table_top") if rng.random() < 0.3 else SquatParams()
    config = PipelineConfig(poses=PoseParams(estimator), detector=detector, squat=squat)
    name = f"seed {seed}: {name}, {estimator}, {detector}, {'; '.join(message)}"
    return LossyTrial(name, recording, config, bool(rng.random() < 0.5))


def _draw_loss(rng: np.random.Generator) -> str:
    return str(rng.choice(["both", "both", "both", "missing", "acc", "gyr", "frozen", "zero", "leap"]))
