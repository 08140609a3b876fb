"""Laws of the live chain: blocks do not matter, nothing is late, strides are as of the whole take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.angles import JointAngles, compute_headings
from sagittal.core.body.feet import FootTracks
from sagittal.core.body.tree import PRESETS
from sagittal.core.events.foot_contact import FootContactParams
from sagittal.core.events.result import GaitEvent, GaitEvents
from sagittal.core.formats.live_log import FILE_MARK, decode_batch, encode_batch, record, scan
from sagittal.core.frames import FOOT, SIDES, Segment
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.online import LiveFrame, LiveStride, OnlineSession
from sagittal.core.online.chain import COURSES
from sagittal.core.parameters.live.live_stride import NOT_YET
from sagittal.core.parameters.measure import MeasuredGait, Tracks, measure_gait
from sagittal.core.signals.recording import UniformRecording
from tests.helpers.live_walks import Run, batches, hello_of, live, recorded
from tests.helpers.marks import sweep_after
from tests.helpers.walks import cut, lost, neura_walk, only, simulated

FILTER_DELAY_S = {"neura_walk": 0.07, "simulated": 0.08}
"""Time from the refined moment of a contact to the sample at which it is told, at 100 Hz, of 95 % of
them; a contact is mostly told before the moment that it is refined to. Swings without pitch, told when they
have ended, are not meant."""
REFINED_S = 0.15
"""Longest time from telling an event to telling its refined time."""

SETS: dict[str, tuple[Segment, ...]] = {
    "seven": PRESETS["lower_body7"],
    "pelvis and feet": PRESETS["feet_pelvis3"],
    "feet": PRESETS["feet2"],
    "pelvis and one leg": ("pelvis", "thigh_r", "shank_r", "foot_r"),
    "shank and foot": ("foot_l", "shank_l"),
    "without feet": ("pelvis", "thigh_l", "shank_l"),
}
METHODS = {"seven": "erkf", "pelvis and feet": "l7s_3i", "feet": "l7s_2i", "pelvis and one leg": "erkf"}


@cache
def walk() -> UniformRecording:
    """Half a minute with a long gap of a foot, a short one of a shank and one of the pelvis."""
    take = cut(simulated("comfortable", 1)[0], 0.0, 28.0)
    take = lost(lost(take, "foot_r", 15.0, 16.2), "shank_l", 18.0, 18.25)
    return lost(take, "pelvis", 21.0, 22.0)


@cache
def worn(name: str) -> UniformRecording:
    take = walk()
    return only(take, *(s for s in take.sensors if s in SETS[name]))


@dataclass(frozen=True, eq=False)
class Told:
    """All messages of the frames, by sample where applicable."""

    events: list[GaitEvent]
    strides: list[LiveStride]
    trail: dict[float, bytes]
    figure: dict[float, tuple[object, ...]]
    notices: list[str]


def told(frames: Sequence[LiveFrame]) -> Told:
    return Told(
        events=[e for f in frames for e in f.events],
        strides=[s for f in frames for s in f.strides],
        trail={
            float(t): row.tobytes()
            for f in frames
            for t, row in zip(f.trail.t_s, f.trail.values, strict=True)
        },
        figure={f.t_s: _figure(f) for f in frames if f.method != "none" or f.angles},
        notices=sorted(str(n) for f in frames for n in f.notices),
    )


def _figure(f: LiveFrame) -> tuple[object, ...]:
    bits = [{s: x.tobytes() for s, x in source.items()} for source in (f.q, f.p)]
    return (f.method, *bits, f.valid, dict(f.contact), np.array(list(f.angles.values())).tobytes())


@cache
def streamed(name: str) -> tuple[tuple[LiveFrame, ...], Told]:
    """A set in batches of ten."""
    frames = live(worn(name))[1]
    return tuple(frames), told(frames)


def same_stride(a: LiveStride, b: LiveStride) -> bool:
    for f in fields(LiveStride):
        x, y = getattr(a, f.name), getattr(b, f.name)
        if f.name == "curves":
            if x.keys() != y.keys() or any(not np.array_equal(x[k], y[k]) for k in x):
                return False
        elif x != y:
            return False
    return True


def same(a: Told, b: Told) -> None:
    """Equal to the bit wherever both have a sample."""
    assert a.events == b.events
    assert len(a.strides) == len(b.strides)
    assert all(same_stride(x, y) for x, y in zip(a.strides, b.strides, strict=True))
    assert a.notices == b.notices
    for one, alternative in ((a.trail, b.trail), (a.figure, b.figure)):
        pair = one.keys() & alternative.keys()
        assert len(pair) >= min(len(one), len(alternative)) // 8
        assert all(one[t] == alternative[t] for t in pair)


@pytest.mark.slow
@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("sizes", sweep_after(1, [7, ((64, 3, 21, 1, 40),), 200, 1]))
def test_batches_of_any_size_give_the_same_bits(name: str, sizes: int | tuple[int, ...]) -> None:
    same(streamed(name)[1], told(live(worn(name), sizes)[1]))


@pytest.mark.slow
@pytest.mark.parametrize("name", SETS)
def test_the_worn_sensors_decide_what_is_shown(name: str) -> None:
    frames, _ = streamed(name)
    last = frames[-1]
    assert last.stage == "running"
    assert last.method == METHODS.get(name, "none")
    codes = {n.code for f in frames for n in f.notices}
    assert ("no_live_figure" in codes) == (name not in METHODS)
    assert bool(last.p) == (name in METHODS)
    assert bool(last.contact) == (name != "without feet")
    if last.method != "none":
        assert last.valid
        heights = [float(last.p[s][2]) for s in last.p if s.startswith("foot")]
        assert max(heights) < 0.3


@pytest.mark.slow
def test_a_chest_sensor_beside_the_seven_stops_neither_calibration_nor_strides() -> None:
    take = worn("seven")
    frames = live(replace(take, sensors={**take.sensors, "chest": take.sensors["pelvis"]}))[1]
    assert (frames[-1].stage, frames[-1].method) == ("running", "erkf")
    assert len(told(frames).strides) == len(streamed("seven")[1].strides)


@pytest.mark.sweep
@pytest.mark.parametrize("sizes", [5, 10])
def test_a_redone_calibration_starts_at_the_next_sample_and_nothing_else_changes(sizes: int) -> None:
    take = simulated("comfortable", 1)[0]
    repeat: dict[int, Told] = {}
    for size in (sizes, 20):
        online, frames = OnlineSession(hello_of(take), take.subject), []
        for batch in batches(take, size):
            if batch.t0_us == 12_000_000:
                online.command("redo_calibration")
                assert online.chain is None
            frames.append(online.push(batch))
        heard = [f for f in frames if f is not None]
        later = [f for f in heard if f.t_s >= 12.0]
        assert later[0].stage == "waiting"
        repeat[size] = told(heard)
    same(repeat[sizes], repeat[20])


@pytest.mark.sweep
def test_the_log_of_a_take_gives_the_same_bits_as_its_stream() -> None:
    take = worn("seven")
    log = FILE_MARK
    sent = []
    online = OnlineSession(hello_of(take), take.subject)
    for batch in batches(take, 10):
        frame = encode_batch(batch)
        log += record("B", frame)
        sent.append(online.push(decode_batch(frame)))
    records, length = scan(log)
    assert length == len(log)
    replay = OnlineSession(hello_of(take), take.subject)
    replayed = [replay.push(decode_batch(r.body)) for r in records]
    same(told([f for f in sent if f]), told([f for f in replayed if f]))


@pytest.mark.slow
def test_an_event_is_told_in_the_push_that_brings_its_sample_and_soon() -> None:
    for name, take in (("simulated", simulated("comfortable", 1)[0]), ("neura_walk", neura_walk())):
        frames = live(take, 1)[1]
        running = [f for f in frames if f.stage == "running"]
        assert len({f.t_s for f in running}) == len(running)
        # the first frame of the chain tells all of the calibration walk
        for f in running[1:]:
            for e in f.events:
                late = f.t_s - e.detected_s
                assert late < 0.5 / take.rate_hz + (0.0 if e.first_s is None else REFINED_S)
        events = [e for f in running for e in f.events]
        clear = [e for e in events if (e.uncertainty_s or 0.0) < FootContactParams().loose_sd_s]
        delays = [e.detected_s - e.time_s for e in clear if e.first_s is not None or e.kind == "tc"]
        assert min(delays) > -0.1
        assert np.percentile(delays, 95) <= FILTER_DELAY_S[name]
        messages = {(e.side, e.time_s) for e in events if e.first_s is None and e.kind == "ic"}
        refined = {(e.side, e.first_s) for e in events if e.first_s is not None}
        assert refined <= messages
        assert len(refined) >= 0.8 * len(messages)


def tracks(run: Run) -> Tracks:
    """What `measure_gait` wants of the whole take."""
    chain, x = run.chain, run.rows
    t_s = np.arange(chain.first, chain.first + len(x["angles"])) / chain.rate_hz
    courses = [s for s in COURSES if s in chain.segments]
    sides = tuple(chain.contact)
    take = Orientations(
        t_s,
        chain.rate_hz,
        {s: x["course"][:, i] for i, s in enumerate(courses)},
        {s: x["course_valid"][:, i].astype(bool) for i, s in enumerate(courses)},
        "",
    )
    feet = FootTracks(
        t_s=t_s,
        rate_hz=chain.rate_hz,
        p={s: x["feet_p"][:, i] for i, s in enumerate(sides)},
        q={s: x["feet_q"][:, i] for i, s in enumerate(sides)},
        still={s: x["feet_still"][:, i].astype(bool) for i, s in enumerate(sides)},
        valid={s: x["feet_valid"][:, i].astype(bool) for i, s in enumerate(sides)},
        linked=chain.estimator.linked,
        source="",
        body=chain.body,
    )
    angles = {name: x["angles"][:, i] for i, name in enumerate(chain.names)}
    return Tracks(
        t_s=t_s,
        rate_hz=chain.rate_hz,
        events=GaitEvents(tuple(run.events)),
        q={FOOT[s]: take.q[FOOT[s]] for s in sides},
        valid={FOOT[s]: take.valid[FOOT[s]] for s in sides},
        feet=feet,
        angles=JointAngles(t_s, angles, {}, headings=compute_headings(take)),
    )


def compared(strides: Sequence[LiveStride], whole: MeasuredGait) -> int:
    """Values of the complete strides that are those of the whole take; fails at the first that is not."""
    index = {(s.side, s.start_s, s.end_s): i for i, s in enumerate(whole.strides.strides)}
    values = 0
    for s in strides:
        if not s.complete:
            continue
        i = index[s.side, s.start_s, s.end_s]
        listed = whole.strides.strides[i]
        assert s.foot_off_s == listed.tc_s
        assert set(s.flags) <= set(listed.flags) | {"outlier"}
        assert {"gap", "incomplete", "implausible_time", "turn", "first", "near_turn"} & set(
            listed.flags
        ) <= set(s.flags) | {"near_turn"}
        for name, column in whole.columns.items():
            ours, theirs = s.values[name], column[i]
            assert (ours is None) == (theirs is None), (s.n, s.side, name, ours, theirs)
            if ours is not None and theirs is not None:
                assert ours == pytest.approx(theirs, rel=1e-9, abs=1e-9), (s.n, name)
                values += 1
            else:
                assert s.reasons[name] not in ("", NOT_YET)
    return values


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in SETS if n != "without feet"])
def test_a_live_stride_has_the_figures_of_the_whole_take(name: str) -> None:
    run = recorded(worn(name))
    whole = measure_gait(tracks(run))
    complete = [s for s in run.strides if s.complete]
    # the take ends in mid-stride: the last of each foot waits for its distances
    assert len({s.n for s in run.strides}) == len(whole.strides.strides) <= len(complete) + 2
    assert compared(run.strides, whole) > 14 * len(complete)


@pytest.mark.sweep
@pytest.mark.parametrize("person", ["hemiparetic", "parkinson", "step_asym"])
def test_it_has_them_of_other_gaits_too(person: str) -> None:
    run = recorded(simulated(person, 2)[0])
    assert compared(run.strides, measure_gait(tracks(run))) > 500


@pytest.mark.recorded
def test_the_stopping_stride_of_each_foot_is_told_again_as_not_counted() -> None:
    """neura_walk stops: strides recognised as last are reported again as not counted."""
    run = recorded(neura_walk())
    whole = measure_gait(tracks(run))
    final = {s.n: s for s in run.strides}
    for side in SIDES:
        last = max((s for s in final.values() if s.side == side), key=lambda s: s.start_s)
        assert (last.complete, last.counted) == (True, False)
        assert "last" in last.flags
    counts = {(s.side, s.start_s) for s in final.values() if s.counted}
    assert counts <= {(s.side, s.start_s) for s in whole.strides.select_used()}


def test_a_stride_is_told_at_once_and_again_with_its_refined_end_and_its_distances() -> None:
    strides = streamed("seven")[1].strides
    messages: dict[int, list[LiveStride]] = {}
    for s in strides:
        initial = messages.setdefault(s.n, [])
        initial.append(s)
        if len(initial) < 3:
            assert not s.complete
            assert s.reasons["stride_length_m"] == NOT_YET
            continue
        assert s.complete
        assert s.detected_s - s.end_s < 1.2
        for name, value in initial[1].values.items():
            if value is not None:
                assert s.values[name] == value
    assert sorted(messages) == list(range(len(messages)))
    for first, second in (x[:2] for x in messages.values() if len(x) > 1):
        assert first.start_s == second.start_s
        assert 0.0 < first.detected_s - first.end_s + 0.05 < 0.15
        assert 0.0 < second.detected_s - first.detected_s <= REFINED_S + 1e-9
        assert abs(second.end_s - first.end_s) < 0.1
    assert all(len(messages[n]) == 3 for n in range(len(messages) - 2))
