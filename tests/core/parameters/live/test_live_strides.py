"""Strides of a live take from true contacts and paths: told at once, and again when more is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.angles import JointAngles, compute_headings
from sagittal.core.events.live_foot import KnownContact
from sagittal.core.events.result import GaitEvent
from sagittal.core.frames import SIDES, Segment, Side
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.parameters.live.live_history import SampleHistory
from sagittal.core.parameters.live.live_stride import NOT_YET, LiveStride
from sagittal.core.parameters.live.live_strides import HistoryColumns, LiveStrides
from sagittal.core.parameters.measure import MeasuredGait, Tracks, measure_gait
from sagittal.core.parameters.spatial import NAMES as SPATIAL
from sagittal.core.parameters.spatial import Surface
from sagittal.core.simulate import Walker, WalkTruth, simulate
from sagittal.core.simulate.script import Stand, Straight
from tests.helpers.true_walks import true_tracks

RATE, BLOCK = 100.0, 10
COURSES: tuple[Segment, ...] = ("pelvis", "foot_l", "foot_r")


@cache
def truth() -> WalkTruth:
    script = (Stand(1.0), Straight(4.5, 0.64, 0.54), Stand(4.0))
    return simulate(script, Walker(), 3).truth


@cache
def tracks() -> Tracks:
    x = true_tracks(truth())
    here = np.ones(len(x.t_s), np.bool_)
    take = Orientations(x.t_s, RATE, {s: truth().q[s] for s in COURSES}, dict.fromkeys(COURSES, here), "")
    return replace(x, angles=JointAngles(x.t_s, truth().angles, {}, headings=compute_headings(take)))


@cache
def whole() -> MeasuredGait:
    return measure_gait(tracks())


def at_once(event: GaitEvent) -> list[KnownContact]:
    """Told three samples after it and never again."""
    at = int(np.ceil(event.time_s * RATE)) + 3
    return [KnownContact(at, event, True)]


def run(
    tell: Callable[[GaitEvent], list[KnownContact]] = at_once,
    *,
    feet: tuple[Side, ...] = SIDES,
    surface: Surface | None = None,
) -> list[LiveStride]:
    """A take in blocks of ten samples."""
    x, paths = tracks(), tracks().feet
    assert paths is not None
    n, names = len(x.t_s), tuple(truth().angles)
    columns = {
        "angles": np.stack([truth().angles[name] for name in names], axis=1),
        "course": np.stack([truth().q[s] for s in COURSES], axis=1),
        "course_valid": np.ones((n, len(COURSES)), np.bool_),
        "feet_p": np.stack([paths.p[s] for s in SIDES], axis=1)[:, : len(feet)],
        "feet_q": np.stack([paths.q[s] for s in SIDES], axis=1)[:, : len(feet)],
        "feet_still": np.stack([paths.still[s] for s in SIDES], axis=1)[:, : len(feet)],
        "feet_valid": np.ones((n, len(feet)), np.bool_),
        "feet_patched": np.zeros((n, len(feet)), np.bool_),
    }
    of = {name: c.shape[1:] for name, c in columns.items()}
    bools = {name for name, c in columns.items() if c.dtype == np.bool_}
    history = SampleHistory(
        RATE,
        {name: shape for name, shape in of.items() if name not in bools},
        {name: shape for name, shape in of.items() if name in bools},
    )
    setup = HistoryColumns(0, RATE, names, COURSES, feet, True, "truth", paths.body, surface or Surface())
    known = sorted((k for e in x.events.events for k in tell(e)), key=lambda k: (k.at, k.event.side))
    strides, told = LiveStrides(setup), []
    for first in range(0, n, BLOCK):
        past = min(first + BLOCK, n)
        history.append({name: c[first:past] for name, c in columns.items()})
        told += strides.push([k for k in known if first <= k.at < past], history)
    return told


def by_number(told: list[LiveStride]) -> dict[int, list[LiveStride]]:
    found: dict[int, list[LiveStride]] = {}
    for s in told:
        found.setdefault(s.n, []).append(s)
    return found


def test_a_stride_is_told_with_its_second_contact_and_again_with_its_distances() -> None:
    listed = whole().strides.strides
    told = by_number(run())
    assert list(told) == list(range(len(listed)))
    for first, last in told.values():
        assert not first.complete
        assert {first.reasons[name] for name in SPATIAL} == {NOT_YET}
        assert 0.0 <= first.detected_s - first.end_s - 0.03 < 0.011
        assert last.complete
        assert NOT_YET not in last.reasons.values()
        assert (first.side, first.start_s, first.end_s) == (last.side, last.start_s, last.end_s)
        assert last.detected_s > first.detected_s


def test_its_figures_are_those_of_the_whole_take() -> None:
    index = {(s.side, s.start_s): i for i, s in enumerate(whole().strides.strides)}
    values = 0
    for told in by_number(run()).values():
        stride = told[-1]
        i = index[stride.side, stride.start_s]
        assert stride.foot_off_s == whole().strides.strides[i].tc_s
        for name, column in whole().columns.items():
            ours, theirs = stride.values[name], column[i]
            assert (ours is None) == (theirs is None) == (name in stride.reasons), name
            if ours is not None and theirs is not None:
                assert abs(ours - theirs) < 1e-9, name
                values += 1
    assert values > 20 * len(index)


def test_only_the_first_and_the_last_stride_of_a_foot_do_not_count() -> None:
    told = by_number(run())
    for side in SIDES:
        flags = [x[-1].flags for x in told.values() if x[-1].side == side]
        assert flags[0] == ("first",)
        assert flags[-1] == ("last",)
        assert not any(flags[1:-1])
        assert [x[-1].counted for x in told.values() if x[-1].side == side] == [not f for f in flags]
    # of the last nobody knows before the three seconds in which a stride may end are over
    stopped = [x for x in told.values() if "last" in x[-1].flags]
    assert all(first.counted and 3.0 <= last.detected_s - last.end_s + 0.01 < 3.02 for first, last in stopped)


def test_a_refined_contact_tells_the_stride_again_under_its_number() -> None:
    def twice(event: GaitEvent) -> list[KnownContact]:
        (known,) = at_once(event)
        if event.kind == "tc":
            return [known]
        rough = replace(event, time_s=event.time_s - 0.02)
        refined = replace(event, first_s=rough.time_s)
        return [KnownContact(known.at, rough, False), KnownContact(known.at + 10, refined, True)]

    plain, told = by_number(run()), by_number(run(twice))
    assert list(told) == list(plain)
    for number, (first, again, last) in told.items():
        assert not first.complete
        assert not again.complete
        assert last.complete
        once = plain[number][0]
        assert first.end_s == once.end_s - 0.02
        assert (again.side, again.start_s, again.end_s) == (once.side, once.start_s, once.end_s)
        assert again.values == pytest.approx(once.values, nan_ok=False)


def test_without_a_path_or_on_a_belt_it_is_complete_at_once() -> None:
    for told in (run(feet=()), run(surface=Surface("treadmill", 1.1))):
        assert told
        assert all(s.complete for s in told)
        assert sorted(s.n for s in told) == list(range(len(told)))
    (length,) = {
        abs(s.values["stride_length_m"] - 1.1 * (s.end_s - s.start_s)) < 1e-9  # type: ignore[operator]
        for s in run(surface=Surface("treadmill", 1.1))
    }
    assert length
