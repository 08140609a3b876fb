"""Daily-life monitor on simulated people with known activities."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator
from dataclasses import replace
from math import radians

import numpy as np
import pytest

from sagittal.core.activity.monitor import monitor_activity
from sagittal.core.activity.params import ActivityParams
from sagittal.core.activity.result import ActivityResult
from sagittal.core.errors import SignalError
from sagittal.core.frames import GRAVITY
from sagittal.core.pipeline import analyse
from sagittal.core.signals.recording import Recording, Subject, as_long_stream
from sagittal.core.signals.sample_blocks import LongStream, SampleBlock
from sagittal.core.simulate import MOVEMENTS
from sagittal.core.simulate.chest import ChestSimulation, ChestStyle, Day, PostureHold, simulate_day
from sagittal.core.simulate.daily import DailyItem, DailySimulation, plan_daily_life, simulate_daily_life
from sagittal.core.simulate.scripts import ON_SKIN

CHAIR: Day = (
    PostureHold("stand", 6.0),
    *(PostureHold("sit", 4.0), PostureHold("stand", 4.0)) * 3,
    PostureHold("walk", 12.0),
    PostureHold("stand", 4.0),
    PostureHold("sit", 4.0),
    PostureHold("lie", 8.0),
    PostureHold("sit", 4.0),
    PostureHold("stand", 5.0),
)
"""Eight times up and down, and once to bed."""

HOURS = 2.0


def simulate_chest(day: Day, seed: int = 0, style: ChestStyle | None = None) -> ChestSimulation:
    return simulate_day(day, seed=seed, setup=replace(ON_SKIN, rate_hz=50.0), style=style)


def watch(result: ChestSimulation) -> ActivityResult:
    (stream,) = result.recording.streams.values()
    return monitor_activity(as_long_stream(stream), "chest", 1.75)


@pytest.fixture(scope="module")
def life() -> DailySimulation:
    return simulate_daily_life(plan_daily_life(HOURS, 5), 1.68, 5, 50.0, has_gyro=True)


@pytest.fixture(scope="module")
def blocks(life: DailySimulation) -> list[SampleBlock]:
    return list(life.stream.open_blocks())


@pytest.fixture(scope="module")
def lived(life: DailySimulation, blocks: list[SampleBlock]) -> ActivityResult:
    return monitor_activity(replace(life.stream, open_blocks=lambda: iter(blocks)), "chest", 1.68)


def cut(stream: LongStream, blocks: list[SampleBlock], rows: int) -> LongStream:
    """The same samples in blocks of so many rows."""

    def open_blocks() -> Iterator[SampleBlock]:
        t_s, acc = (np.concatenate([getattr(b, name) for b in blocks]) for name in ("t_s", "acc"))
        gyr = np.concatenate([b.gyr for b in blocks if b.gyr is not None])
        for i in range(0, len(t_s), rows):
            yield SampleBlock(t_s[i : i + rows], acc[i : i + rows], gyr[i : i + rows])

    return replace(stream, open_blocks=open_blocks)


@pytest.mark.slow
@pytest.mark.parametrize(("lean", "takes"), [(25.0, 1.5), (35.0, 2.5), (45.0, 3.5)])
def test_all_transitions_are_found_near_their_time(lean: float, takes: float) -> None:
    chest = simulate_chest(CHAIR, 1, ChestStyle(lean_rad=radians(lean), change_s=takes))
    true = [p for p in chest.truth.phases if "_to_" in p.kind]
    watch_result = watch(chest)
    assert [t.kind for t in watch_result.transitions] == [p.kind for p in true]
    assert all(t.consistent for t in watch_result.transitions)
    for t, p in zip(watch_result.transitions, true, strict=True):
        assert p.start_s - 0.5 <= t.time_s <= p.end_s + 0.5
        if t.rise_m is not None:
            assert abs(t.rise_m) == pytest.approx(0.4, abs=0.08)


def test_a_bow_is_no_transition() -> None:
    day = (
        PostureHold("walk", 10.0),
        PostureHold("stand", 4.0),
        PostureHold("bow", 3.0),
        PostureHold("stand", 4.0),
    )
    watch_result = watch(simulate_chest((*day, PostureHold("bow", 2.5), PostureHold("stand", 4.0)), 2))
    assert not watch_result.transitions
    assert [c.refused for c in watch_result.candidates] == ["chest_did_not_rise"] * 2
    assert {s.kind for s in watch_result.spans} == {"walking", "standing"}


def test_a_careful_lean_is_told_as_a_candidate_and_settles_the_posture() -> None:
    chest = simulate_chest(CHAIR, 3, ChestStyle(lean_rad=radians(15.0)))
    watch_result = watch(chest)
    assert {t.kind for t in watch_result.transitions} == {"sit_to_lie", "lie_to_sit"}
    true = [p.kind for p in chest.truth.phases if p.kind in ("sit_to_stand", "stand_to_sit")]
    assert [c.likely for c in watch_result.sub_threshold] == true


def test_the_steps_are_counted_and_lie_in_the_walk() -> None:
    chest = simulate_chest(
        (PostureHold("stand", 5.0), PostureHold("walk", 20.0, 108.0), PostureHold("stand", 5.0)), 4
    )
    watch_result = watch(chest)
    assert abs(len(watch_result.steps_s) - len(chest.truth.steps_s)) <= 1
    (bout,) = watch_result.bouts
    assert bout.kind == "walking"
    assert bout.cadence_spm == pytest.approx(108.0, rel=0.03)


def test_inclination_is_positive_forward() -> None:
    chest = simulate_chest(MOVEMENTS["chair_rises"].does, 5)  # type: ignore[arg-type]
    watch_result = watch(chest)
    true = np.degrees(chest.truth.pitch_rad)
    seconds = true[: 50 * (len(true) // 50)].reshape(-1, 50).mean(axis=1)
    pair = watch_result.inclination_deg[: len(seconds)] - np.nanmedian(
        watch_result.inclination_deg[: len(seconds)] - seconds
    )
    assert np.nanmax(np.abs(pair - seconds)) < 6.0
    assert np.nanmax(watch_result.inclination_deg) > 15.0


@pytest.mark.slow
@pytest.mark.parametrize("rows", [977, 200_000])
def test_how_the_blocks_are_cut_changes_no_bit(
    life: DailySimulation, blocks: list[SampleBlock], lived: ActivityResult, rows: int
) -> None:
    second_activity = monitor_activity(cut(life.stream, blocks, rows), "chest", 1.68)
    for name in ("spans", "transitions", "candidates", "bouts", "turns", "hours", "days", "periods"):
        assert getattr(second_activity, name) == getattr(lived, name)
    assert second_activity.steps_s.tobytes() == lived.steps_s.tobytes()
    assert second_activity.inclination_deg.tobytes() == lived.inclination_deg.tobytes()


@pytest.mark.slow
def test_the_spans_fill_the_time_from_end_to_end(lived: ActivityResult) -> None:
    assert lived.spans[0].start_s == 0.0
    assert lived.spans[-1].end_s == lived.duration_s
    assert all(a.end_s == b.start_s for a, b in zip(lived.spans, lived.spans[1:], strict=False))
    for sums in (lived.hours, lived.days):
        assert sum(sum(x.minutes.values()) for x in sums) == pytest.approx(lived.duration_s / 60.0)
        assert sum(x.steps for x in sums) == len(lived.steps_s)


def test_two_hours_are_told_as_they_were(life: DailySimulation, lived: ActivityResult) -> None:
    true = [p for p in life.phases if "_to_" in p.kind]
    met = [
        p for p in true
        if any(t.kind == p.kind and p.start_s - 1.0 <= t.time_s <= p.end_s + 1.0 for t in lived.transitions)
    ]  # fmt: skip
    assert len(met) == len(true) == len(lived.transitions)
    assert len(lived.steps_s) == pytest.approx(len(life.steps_s), rel=0.03)


def test_without_the_gyroscope_the_same_is_found(
    life: DailySimulation, blocks: list[SampleBlock], lived: ActivityResult
) -> None:
    bare = [SampleBlock(b.t_s, b.acc, None) for b in blocks]
    single_variant = replace(life.stream, has_gyro=False, open_blocks=lambda: iter(bare))
    activity = monitor_activity(single_variant, "chest", 1.68)
    assert [t.kind for t in activity.transitions] == [t.kind for t in lived.transitions]
    assert activity.steps_s.tobytes() == lived.steps_s.tobytes()
    assert not activity.turns


def test_a_sensor_on_the_table_and_a_hole_are_told_apart_from_sitting() -> None:
    plan = (
        DailyItem("walk", 20.0), DailyItem("sit", 120.0), DailyItem("stand", 10.0), DailyItem("off", 2400.0),
        DailyItem("stand", 10.0), DailyItem("walk", 30.0), DailyItem("sit", 2400.0), DailyItem("stand", 60.0),
    )  # fmt: skip
    life = simulate_daily_life(plan, 1.7, 6, 50.0)
    hole = (life.phases[-3].start_s + 100.0, life.phases[-3].start_s + 130.0)

    def open_blocks() -> Iterator[SampleBlock]:
        for b in life.stream.open_blocks():
            target = (b.t_s < hole[0]) | (b.t_s >= hole[1])
            yield SampleBlock(b.t_s[target], b.acc[target], None)

    activity = monitor_activity(replace(life.stream, open_blocks=open_blocks), "chest", 1.7)
    assert activity.minutes("gap") == pytest.approx(0.5, abs=0.02)
    assert activity.minutes("non_wear") == pytest.approx(40.0, abs=1.0)
    assert activity.minutes("sitting") == pytest.approx(41.5, abs=1.5)
    assert [p.method for p in activity.periods] == ["walking", "walking"]


def test_hours_and_days_are_those_of_the_devices_clock(
    life: DailySimulation, blocks: list[SampleBlock]
) -> None:
    start = dt.datetime(2026, 3, 4, 23, 10)  # noqa: DTZ001 - the device's own clock
    clocked = replace(life.stream, started_at=start, open_blocks=lambda: iter(blocks))
    activity = monitor_activity(clocked, "chest", 1.68)
    assert activity.hours[0].end_s == 50 * 60.0
    assert [d.date for d in activity.days] == [dt.date(2026, 3, 4), dt.date(2026, 3, 5)]


def still(rate: float, seconds: float = 60.0) -> LongStream:
    t_s = np.arange(int(seconds * rate)) / rate
    acc = np.tile([0.0, 0.0, GRAVITY], (len(t_s), 1))
    block = SampleBlock(t_s, acc, None)
    return LongStream("A", "a.csv", rate, False, seconds, lambda: iter([block]))


def test_too_slow_a_recording_is_refused_with_what_is_needed() -> None:
    with pytest.raises(SignalError, match="at least 20 Hz") as error:
        monitor_activity(still(12.5), "chest")
    assert error.value.code == "sample_rate_too_low"


def test_what_is_assumed_is_said() -> None:
    activity = monitor_activity(still(25.0), "chest")
    assert {n.code for n in activity.notices} == {"height_assumed", "baseline_assumed", "forward_unknown"}
    assert np.isnan(activity.inclination_deg).all()
    assert [(s.kind, s.evidence) for s in activity.spans] == [("unknown", "nothing_known")]


def test_samples_without_numbers_are_an_error() -> None:
    nothing = SampleBlock(np.arange(10.0), np.full((10, 3), np.nan), None)
    with pytest.raises(SignalError, match="no complete sample"):
        monitor_activity(replace(still(25.0), open_blocks=lambda: iter([nothing])), "chest")


def test_other_slabs_find_the_same_transitions(
    life: DailySimulation, blocks: list[SampleBlock], lived: ActivityResult
) -> None:
    stream = replace(life.stream, open_blocks=lambda: iter(blocks))
    activity = monitor_activity(stream, "chest", 1.68, ActivityParams(slab_s=300))
    assert [t.kind for t in activity.transitions] == [t.kind for t in lived.transitions]
    assert abs(len(activity.steps_s) - len(lived.steps_s)) <= 2


def test_every_hour_is_told_while_it_goes_on() -> None:
    t = np.arange(4 * 3600 * 25) / 25.0
    acc = np.tile([0.0, 0.0, GRAVITY], (len(t), 1))
    stream = LongStream("A", "a", 25.0, False, 4 * 3600.0, lambda: iter([SampleBlock(t, acc, None)]))
    notices: list[tuple[str, float]] = []
    source = Recording({}, {"A": "chest"}, Subject(1.7), "activity", long={"A": stream})
    analyse(source, progress=lambda stage, share: notices.append((stage, share)))
    shares = [share for stage, share in notices if stage == "activity"]
    # the fourth hour ends with the recording, a sample early: the next stage tells that
    assert shares == pytest.approx([0.0, 0.2375, 0.475, 0.7125])
    assert notices[-2:] == [("quality", 0.95), ("done", 1.0)]


@pytest.mark.parametrize("lost", [0.0, np.nan])
def test_samples_that_were_not_measured_are_a_hole(lost: float) -> None:
    chest = simulate_chest(CHAIR)
    (stream,) = chest.recording.streams.values()
    half = np.arange(len(stream.t_s)) < len(stream.t_s) // 2
    acc, gyr = (np.where(half[:, None], x, lost) for x in (stream.acc, stream.gyr) if x is not None)
    activity = monitor_activity(as_long_stream(replace(stream, acc=acc, gyr=gyr), 100), "chest", 1.75)
    assert activity.steps_s.max(initial=0.0) < stream.t_s[len(stream.t_s) // 2]
    nothing = replace(stream, acc=np.full_like(stream.acc, lost))
    with pytest.raises(SignalError, match="no complete sample"):
        monitor_activity(as_long_stream(nothing, 100), "chest", 1.75)
