"""Irregular live trials: belts, losses, failed filters, other rates, no standing."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from sagittal.core.body.erkf.live_figure import LinkedBody
from sagittal.core.body.tree import PRESETS
from sagittal.core.errors import Notice, ParameterError
from sagittal.core.frames import SIDES, Segment
from sagittal.core.online import LiveFrame, LiveStride
from sagittal.core.online.session import OnlineSession
from sagittal.core.parameters.spatial import NAMES as SPATIAL
from sagittal.core.signals.recording import SensorSignals, UniformRecording
from tests.helpers.live_walks import batches, hello_of, live, recorded
from tests.helpers.perturbations import delay_sensor
from tests.helpers.walks import cut, lost, only, simulated

BELT = 1.1


def walk(end_s: float = 24.0) -> UniformRecording:
    return cut(simulated("comfortable", 1)[0], 0.0, end_s)


def strides_of(frames: list[LiveFrame]) -> list[LiveStride]:
    return [s for f in frames for s in f.strides]


def codes(frames: list[LiveFrame]) -> list[str]:
    return [n.code for f in frames for n in f.notices]


@pytest.mark.sweep
@pytest.mark.parametrize("speed", [BELT, None])
def test_on_a_belt_distances_are_the_belts_or_none(speed: float | None) -> None:
    take = walk()
    online = OnlineSession(hello_of(take), take.subject, "treadmill", belt_speed_mps=speed)
    frames = [f for b in batches(take) if (f := online.push(b)) is not None]
    strides = strides_of(frames)
    assert len(strides) > 20
    final = {s.n: s.complete for s in strides}
    # the end of the last stride of a foot may not be refined yet
    assert sum(final.values()) >= len(final) - 2
    for s in strides:
        for name in SPATIAL:
            if speed is not None and name in ("gait_speed_mps", "stride_length_m"):
                continue
            assert s.values[name] is None
            assert s.reasons[name] == "treadmill"
        length = s.values["stride_length_m"]
        assert (length is None) == (speed is None)
        if length is not None:
            assert length == pytest.approx(BELT * (s.end_s - s.start_s))


def test_a_belts_speed_without_a_treadmill_is_refused() -> None:
    take = walk()
    with pytest.raises(ParameterError) as caught:
        OnlineSession(hello_of(take), take.subject, "walk", belt_speed_mps=BELT)
    assert caught.value.code == "belt_speed_without_treadmill"


@pytest.mark.sweep
@pytest.mark.parametrize("segment", ["foot_r", "shank_l", "pelvis"])
def test_a_lost_sensor_comes_back_into_the_figure(segment: Segment) -> None:
    """What hangs on it is withheld while it is away; a few steps later all is as if nothing had been."""
    whole, holed = walk(), lost(walk(), segment, 14.0, 15.5)
    expected, recording = recorded(whole), recorded(holed)
    offset = [f for f in recording.frames if 14.3 < f.t_s < 15.4]
    assert offset
    assert not any(f.valid or segment in f.q for f in offset)
    assert all(np.isfinite(list(f.angles.values())).sum() >= 8 for f in offset)
    # a foot is believed again from its next rest on
    back = [f for f in recording.frames if f.t_s > (16.6 if segment == "foot_r" else 15.7)]
    assert all(f.valid for f in back)
    for name, angle in recording.angles_deg.items():
        if "flexion" in name:
            assert np.abs(angle - expected.angles_deg[name])[-500:].max() < 3.0, name
    gaps = [s for s in recording.strides if "gap" in s.flags]
    assert bool(gaps) == segment.startswith("foot")
    for s in gaps:
        assert not s.counted


@pytest.mark.sweep
@pytest.mark.parametrize("seconds", [0.5, 1.0, 5.0])
def test_feet_by_themselves_begin_anew_at_their_next_rest(seconds: float) -> None:
    """The tablet is out of reach: no samples arrive, one foot is in mid-swing."""
    take = only(walk(32.0), "pelvis", "foot_l", "foot_r")
    holed = take
    for segment in take.sensors:
        holed = lost(holed, segment, 15.0, 15.0 + seconds)
    whole, result = ([s for s in recorded(x).strides if s.complete] for x in (take, holed))
    updated = [s for s in result if s.start_s > 15.0 + seconds + 1.5]
    assert len(updated) > 10
    for s in updated:
        (same,) = (x for x in whole if x.side == s.side and abs(x.end_s - s.end_s) < 0.1)
        one, other_values = same.values["stride_length_m"], s.values["stride_length_m"]
        assert one is not None
        assert other_values is not None
        assert other_values == pytest.approx(one, abs=0.03), (s.side, s.end_s)


@pytest.mark.slow
def test_a_filter_that_breaks_says_so_once_and_contacts_go_on() -> None:
    take = walk()
    online = OnlineSession(hello_of(take), take.subject)
    frames, broken = [], False
    for batch in batches(take):
        frame = online.push(batch)
        if frame is None:
            continue
        frames.append(frame)
        if frame.t_s > 14.0 and not broken:
            broken = True
            assert online.chain is not None
            assert isinstance(online.chain.estimator, LinkedBody)
            # nothing from outside breaks it
            core = online.chain.estimator._filtered._filter
            assert core is not None
            core._memory.P[:] = -1.0
    assert codes(frames).count("live_figure_lost") == 1
    updated = [f for f in frames if f.t_s > 14.2]
    assert not any(f.valid or f.q or f.p for f in updated)
    assert all(np.isnan(list(f.angles.values())).all() for f in updated)
    assert len([e for f in updated for e in f.events]) > 20
    late = [s for s in strides_of(updated) if s.start_s > 14.2]
    assert len(late) > 8
    for s in late:
        assert s.values["stride_time_s"] is not None
        assert s.values["stride_length_m"] is None
        assert s.values["knee_flexion_max_swing_deg"] is None


def slower(take: UniformRecording, rate_hz: float) -> UniformRecording:
    """The same at another rate, linearly between its samples."""
    t_s = np.arange(0.0, take.t_s[-1], 1.0 / rate_hz)

    def thin(x: SensorSignals) -> SensorSignals:
        acc, gyr = (np.stack([np.interp(t_s, take.t_s, c) for c in y.T], axis=1) for y in (x.acc, x.gyr))
        ok = np.ones(len(t_s), np.bool_)
        return replace(x, acc=acc, gyr=gyr, mag=None, valid=ok, interpolated=~ok)

    return replace(take, t_s=t_s, rate_hz=rate_hz, sensors={s: thin(x) for s, x in take.sensors.items()})


@pytest.mark.sweep
@pytest.mark.parametrize("rate_hz", [60.0, 120.0])
def test_sensors_of_another_rate_walk_the_same_strides(rate_hz: float) -> None:
    hundred = [s for s in recorded(walk()).strides if s.complete]
    second = [s for s in recorded(slower(walk(), rate_hz)).strides if s.complete]
    assert len(hundred) == len(second)
    for a, b in zip(hundred, second, strict=True):
        assert a.side == b.side
        assert a.start_s == pytest.approx(b.start_s, abs=0.04)
        one, two = a.values["stride_length_m"], b.values["stride_length_m"]
        assert one is not None
        assert two is not None
        assert one == pytest.approx(two, abs=0.04)


def test_what_cannot_be_calibrated_gives_frames_all_the_same() -> None:
    """Without standing the frames report the waiting stage and no values."""
    take = cut(simulated("comfortable", 1)[0], 8.0, 20.0)
    _, frames = live(take)
    assert frames
    assert {f.stage for f in frames} <= {"waiting", "stand"}
    assert not strides_of(frames)
    assert not any(f.q or f.angles or f.events for f in frames)
    assert all(len(f.health) == len(take.sensors) for f in frames)


@pytest.mark.slow
def test_health_is_of_the_last_seconds() -> None:
    take = lost(walk(), "foot_r", 12.0, 14.5)
    _, frames = live(take)
    by_time = {round(f.t_s, 2): {h.segment: h for h in f.health} for f in frames}
    initial, during, updated = (by_time[t] for t in (11.99, 14.49, 23.99))
    assert initial["foot_r"].lost_share == 0.0
    assert during["foot_r"].lost_share == pytest.approx(0.5, abs=0.03)
    assert during["foot_l"].lost_share == 0.0
    assert updated["foot_r"].lost_share == 0.0
    assert all(h.rate_hz == pytest.approx(100.0, rel=0.01) for h in updated.values())
    assert by_time[2.99]["pelvis"].still
    assert not updated["foot_l"].still or not updated["foot_r"].still


@pytest.mark.slow
def test_contact_follows_the_events() -> None:
    _, frames = live(only(walk(), "foot_l", "foot_r", "pelvis"), 1)
    running = [f for f in frames if f.stage == "running"][1:]
    state = dict(running[0].contact)
    for f in running[1:]:
        for e in f.events:
            state[e.side] = e.kind == "ic"
        assert dict(f.contact) == state
    assert set(state) == set(SIDES)


@pytest.mark.slow
@pytest.mark.parametrize(("a", "b"), [("shank_l", "shank_r"), ("foot_l", "foot_r")])
def test_exchanged_sensors_are_told_while_they_stream(a: Segment, b: Segment) -> None:
    take = walk()
    swapped = dict(take.sensors)
    swapped[a], swapped[b] = swapped[b], swapped[a]
    right, wrong = live(take)[1], live(replace(take, sensors=swapped))[1]
    assert "sensors_do_not_hang_together" not in codes(right)
    notices = [n for f in wrong for n in f.notices if n.code == "sensors_do_not_hang_together"]
    assert notices
    assert len({n.message for n in notices}) == len(notices)


@pytest.mark.slow
def test_one_foot_may_walk_on_while_the_other_is_away() -> None:
    """Many contacts of one side between two of the other: no stride is lost or completed twice."""
    run = recorded(lost(walk(30.0), "foot_r", 14.0, 19.0))
    complete = [s.n for s in run.strides if s.complete]
    assert len(complete) == len(set(complete))
    assert set(range(max(complete) - 1)) <= set(complete)
    offset = [s for s in run.strides if s.complete and 14.5 < s.start_s < 17.0]
    assert offset
    assert {s.side for s in offset} == {"left"}
    assert all(s.values["stride_length_m"] is not None for s in offset)


def compared(take: UniformRecording, sizes: int | tuple[int, ...]) -> tuple[OnlineSession, list[Notice]]:
    """A take whose sensors are compared after every batch, as an estimator process does."""
    online, notices = OnlineSession(hello_of(take), take.subject), []
    for batch in batches(take, sizes):
        if online.push(batch) is not None:
            notices += online.compare_sensors()
    return online, notices


@pytest.mark.sweep
def test_a_late_sensor_is_told_and_marked_until_calibrated_again() -> None:
    late = delay_sensor(only(walk(), *PRESETS["lower_body7"]), "shank_l", 0.05)
    online, notices = compared(late, 10)
    assert [(n.code, n.sensor) for n in notices] == [("sensor_late", "shank_l")]
    assert compared(late, (3, 41, 170))[1] == notices
    last = list(batches(late))[-1]
    second_variant = replace(
        last, seq=last.seq + 1, t0_us=last.t0_us + 100_000, sent_us=last.sent_us + 100_000
    )
    frame = online.push(second_variant)
    assert frame is not None
    assert {h.segment: h.doubt for h in frame.health if h.doubt} == {"shank_l": "sensor_late"}
    online.command("redo_calibration")
    frame = online.push(
        replace(
            second_variant,
            seq=second_variant.seq + 1,
            t0_us=second_variant.t0_us + 100_000,
            sent_us=second_variant.sent_us + 100_000,
        )
    )
    assert frame is not None
    assert not any(h.doubt for h in frame.health)


def test_a_walk_has_no_test_to_guide_and_a_timed_one_has() -> None:
    take = walk(1.0)
    plain = OnlineSession(hello_of(take))
    assert plain.guide_test() is None
    assert plain.segments == tuple(take.sensors)
    # nothing to go for, and a word that nobody knows
    plain.command("test", "go")
    plain.command("dance")
    assert plain.guide_test() is None
    assert plain.compare_sensors() == []
    for protocol, phase in (("standing_eyes_open", "ready"), ("tug", "get_ready")):
        timed = OnlineSession(hello_of(take), protocol=protocol)  # type: ignore[arg-type]
        initial = timed.guide_test()
        assert initial is not None
        assert (initial.protocol, initial.phase) == (protocol, "get_ready")
        timed.command("test", "go")
        updated = timed.guide_test()
        assert updated is not None
        # who rises from a chair begins by rising
        assert updated.phase == phase
        timed.command("test", "repeat")
        second = timed.guide_test()
        assert second is not None
        assert second.phase == "get_ready"


def test_a_frame_is_of_the_last_sample_that_is_known() -> None:
    take = walk(2.0)
    session = OnlineSession(hello_of(take))
    frames = [(b.seq, session.push(b)) for b in batches(take)]
    notices = [(seq, f) for seq, f in frames if f is not None]
    assert notices
    assert [f.seq for _, f in notices] == [seq for seq, _ in notices]
    assert all(a.t_s < b.t_s for (_, a), (_, b) in pairwise(notices))
    assert notices[-1][1].t_s <= take.t_s[-1]
    last = notices[-1][1]
    assert (last.method, last.stage) == ("none", "stand")
    assert {h.segment for h in last.health if h.still} == set(take.sensors)
