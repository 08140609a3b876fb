"""Radio dropouts of one foot in walking: counted parameters are unchanged, or suppressed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Literal

import numpy as np
import pytest

from sagittal.core.frames import FOOT, SIDES, Segment
from sagittal.core.online import LiveStride
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.simulate.script import Arc, Script, Stand, Straight
from tests.helpers.live_walks import live
from tests.helpers.walks import cut, only, scripted, simulated

Fault = Literal["freeze", "hole", "burst"]
"""The last sample again and again; no rows at all; six of ten rows missing."""

SETS: dict[str, tuple[Segment, ...]] = {
    "feet": ("foot_l", "foot_r"),
    "feet_pelvis": ("pelvis", "foot_l", "foot_r"),
    "all": ("pelvis", "thigh_l", "thigh_r", "shank_l", "shank_r", "foot_l", "foot_r"),
}

TOLERANCE = {"s": 0.06, "m": 0.1, "mps": 0.12}
"""Of every counted time, distance and speed of a stride against the same take without the fault, by unit."""

SAME_S = 0.25
"""The two ends of a stride with and without the fault."""

ARC: Script = (
    Stand(5), Straight(12.8, 0.64, 0.54), Arc(1.5, 3.14, 0.52, 0.56), Straight(12.8, 0.64, 0.54), Stand(3)
)  # fmt: skip


@cache
def take(walk: str, segments: str) -> UniformRecording:
    whole = scripted(ARC)[0] if walk == "arc" else cut(simulated(walk, 1)[0], 0.0, 34.0)
    return only(whole, *SETS[segments])


def strides_of(recording: UniformRecording) -> list[LiveStride]:
    """Last reported version of each stride."""
    return list({s.n: s for f in live(recording)[1] for s in f.strides}.values())


@cache
def undisturbed(walk: str, segments: str) -> list[LiveStride]:
    return strides_of(take(walk, segments))


def disturbed(
    recording: UniformRecording,
    segment: Segment,
    fault: Fault,
    start_s: float,
    length_s: float,
    seed: int = 0,
) -> UniformRecording:
    x = recording.sensors[segment]
    a, b = (round(t * recording.rate_hz) for t in (start_s, start_s + length_s))
    acc, gyr, valid = x.acc.copy(), x.gyr.copy(), x.valid.copy()
    if fault == "freeze":
        acc[a:b], gyr[a:b] = acc[a - 1], gyr[a - 1]
    elif fault == "hole":
        valid[a:b] = False
    else:
        valid[a:b] &= np.random.default_rng(seed).random(len(valid[a:b])) > 0.6
    sensors = {**recording.sensors, segment: replace(x, acc=acc, gyr=gyr, valid=valid)}
    return replace(recording, sensors=sensors)


def find_wrong(result: list[LiveStride], whole: list[LiveStride]) -> list[tuple[object, ...]]:
    """Counted parameters beyond `TOLERANCE`, and counted strides that do not exist."""
    wrong: list[tuple[object, ...]] = []
    for s in (s for s in result if s.counted):
        same = [x for x in whole if x.side == s.side and abs(x.end_s - s.end_s) < SAME_S]
        if not same:
            wrong.append((s.side, s.start_s, s.end_s))
            continue
        true = min(same, key=lambda x: abs(x.end_s - s.end_s))
        for name, value in s.values.items():
            limit, expected = TOLERANCE.get(name.rsplit("_", 1)[-1]), true.values[name]
            if limit is not None and None not in (value, expected) and abs(value - expected) > limit:  # type: ignore[operator]
                wrong.append((s.side, s.end_s, name, value, expected))
    return wrong


def test_what_the_tests_compare_with_counts() -> None:
    assert find_wrong(undisturbed("comfortable", "feet"), undisturbed("comfortable", "feet")) == []
    assert sum(s.counted for s in undisturbed("comfortable", "feet")) > 30


@pytest.mark.slow
@pytest.mark.parametrize(
    ("walk", "worn", "segment", "fault", "start_s", "length_s"),
    [
        # contacts of the foot doubled: strides of 0.41 and 0.65 s instead of 1.08, for 10 s
        ("arc", "feet", "foot_l", "freeze", 20.9, 0.5),
        ("comfortable", "feet", "foot_l", "freeze", 15.3, 0.3),
        # a step of 0.68 instead of 0.54 s, a stride of 1.23 instead of 1.09
        ("comfortable", "feet", "foot_l", "hole", 15.3, 0.3),
        # a stride of 1.42 instead of 1.27 m
        ("arc", "feet", "foot_l", "burst", 28.88, 0.15),
        # sideways 0.29 instead of 0.04 m
        ("hemiparetic", "feet", "foot_r", "freeze", 19.21, 0.03),
        # lengths of both feet off by up to 1.9 m
        ("comfortable", "all", "foot_l", "freeze", 15.3, 0.3),
        ("comfortable", "all", "foot_l", "freeze", 15.5, 0.2),
    ],
)  # fmt: skip
def test_a_hiccup_leaves_no_wrong_number_that_counts(
    walk: str, worn: str, segment: Segment, fault: Fault, start_s: float, length_s: float
) -> None:
    whole = undisturbed(walk, worn)
    strides = strides_of(disturbed(take(walk, worn), segment, fault, start_s, length_s, 1))
    assert find_wrong(strides, whole) == []
    for side in ("left", "right"):
        target, left = (sum(s.counted for s in x if s.side == side) for x in (whole, strides))
        assert left >= target - 3


@pytest.mark.sweep
@pytest.mark.parametrize("seed", range(60))
def test_no_hiccup_leaves_a_wrong_number_that_counts(seed: int) -> None:
    r = np.random.default_rng(seed)
    walk = str(r.choice(["arc", "comfortable", "hemiparetic", "fast_with_turns", "slow"]))
    text, segment = str(r.choice(list(SETS))), FOOT[SIDES[int(r.integers(2))]]
    fault: Fault = ("freeze", "hole", "burst")[int(r.integers(3))]
    recording = take(walk, text)
    length_s = float(r.choice([0.03, 0.05, 0.08, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.7]))
    start_s = float(r.uniform(13.0, recording.t_s[-1] - 3.0))
    if fault == "hole" and r.random() < 0.2:
        length_s = float(recording.t_s[-1]) - start_s - float(r.uniform(0.0, 1.0))
    strides = strides_of(disturbed(recording, segment, fault, start_s, length_s, seed))
    assert find_wrong(strides, undisturbed(walk, text)) == [], (walk, text, segment, fault, start_s, length_s)
