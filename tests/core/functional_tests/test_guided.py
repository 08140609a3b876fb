"""A functional test that is followed as its samples come: phases, and the figures of the same take's file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.events.result import GaitEvent
from sagittal.core.frames import GRAVITY, SIDES, Protocol, Segment
from sagittal.core.functional_tests.chair import measure_chair_rises
from sagittal.core.functional_tests.guided import GuidedTest
from sagittal.core.functional_tests.result import FunctionalTest, GuidedTestView
from sagittal.core.functional_tests.sway import measure_sway
from sagittal.core.functional_tests.trunk import follow_trunk
from sagittal.core.functional_tests.tug import measure_tug
from sagittal.core.parameters.live.live_stride import LiveStride
from sagittal.core.signals.recording import GivenLimits, UniformRecording
from sagittal.core.timeline.live import UniformBlock
from tests.core.functional_tests.test_timed_tests import rises, tug, wear

RATE = 100.0

REFINED_S = 0.02
"""What is shown live may differ by so much from the file of the whole take."""


def blocks(take: UniformRecording, size: int) -> Iterator[UniformBlock]:
    """A take in blocks of one size."""
    sensors = list(take.sensors.values())
    acc, gyr, valid = (np.stack([getattr(x, k) for x in sensors], axis=1) for k in ("acc", "gyr", "valid"))
    for i in range(0, len(acc), size):
        k = slice(i, i + size)
        yield UniformBlock(i, take.t_s[k], acc[k], gyr[k], valid[k], ~valid[k])


def told(test: GuidedTest, take: UniformRecording, size: int) -> list[GuidedTestView]:
    """Every view that differs in phase from the one before."""
    views = [test.view]
    for block in blocks(take, size):
        test.push(block)
        view = test.advance()
        if (view.phase, view.final, view.problem) != (views[-1].phase, views[-1].final, views[-1].problem):
            views.append(view)
    return views


def followed(take: UniformRecording, protocol: Protocol, size: int = 10) -> list[GuidedTestView]:
    return told(GuidedTest(protocol, tuple(take.sensors), take.rate_hz), take, size)


def means(test: FunctionalTest | None) -> dict[str, float | None]:
    assert test is not None
    return {p.name: p.mean for p in test.parameters}


@cache
def pelvis_tug(patient: str = "healthy") -> UniformRecording:
    return wear(tug(patient)[0], "pelvis")


@cache
def pelvis_rises() -> UniformRecording:
    return wear(rises()[0], "pelvis")


@pytest.mark.parametrize("segment", ["pelvis", "chest"])
def test_a_timed_up_and_go_starts_and_stops_by_itself(segment: Segment) -> None:
    take = wear(tug()[0], segment)
    views = followed(take, "tug")
    assert [v.phase for v in views] == ["get_ready", "ready", "running", "done", "done"]
    running, done, last = views[2], views[3], views[4]
    file = measure_tug(follow_trunk(take))
    assert file.start_s is not None
    assert file.end_s is not None
    assert running.start_s == pytest.approx(file.start_s, abs=0.3)
    assert file.end_s + 1.0 <= done.t_s <= file.end_s + 2.25
    assert last.final
    assert last.result is not None
    assert last.result.segments == done.result.segments if done.result else False
    got, want = means(last.result), means(file)
    assert {n: v for n, v in got.items() if n.endswith("_s")} == pytest.approx(
        {n: v for n, v in want.items() if n.endswith("_s")}, abs=REFINED_S
    )
    assert (last.start_s, last.end_s) == pytest.approx((file.start_s, file.end_s), abs=REFINED_S)


@pytest.mark.slow
def test_any_blocks_give_the_same_bits() -> None:
    one, *remaining = (followed(pelvis_tug(), "tug", size)[-1] for size in (1, 10, 37))
    assert one.final
    for second in remaining:
        assert means(second.result) == means(one.result)
        assert (second.start_s, second.end_s) == (one.start_s, one.end_s)


def test_five_rises_are_counted_and_end_seated() -> None:
    take = pelvis_rises()
    guided = GuidedTest("five_sit_to_stand", ("pelvis",), take.rate_hz)
    counted_strides = []
    for block in blocks(take, 10):
        guided.push(block)
        view = guided.advance()
        if view.phase == "running" and view.rises not in counted_strides:
            counted_strides.append(view.rises)
    assert counted_strides == [0, 1, 2, 3, 4, 5]
    file = measure_chair_rises(follow_trunk(take))
    assert means(guided.view.result) == pytest.approx(means(file), abs=REFINED_S, rel=0.01)


def test_three_rises_end_after_a_long_rest_and_say_so() -> None:
    take = wear(rises("healthy", 3)[0], "pelvis")
    views = followed(longer(take, 12.0), "five_sit_to_stand")
    assert views[-1].phase == "done"
    assert views[-1].result is not None
    assert {p.reason for p in views[-1].result.parameters} == {"too_few_rises"}


def longer(take: UniformRecording, seconds: float) -> UniformRecording:
    """The same with its last second held on."""
    more = round(seconds * take.rate_hz)
    sensors = {}
    for s, x in take.sensors.items():
        index = np.concatenate(
            (np.arange(len(x.acc)), np.resize(np.arange(len(x.acc) - 50, len(x.acc)), more))
        )
        sensors[s] = replace(
            x, acc=x.acc[index], gyr=x.gyr[index], mag=None, valid=x.valid[index],
            interpolated=x.interpolated[index],
        )  # fmt: skip
    return replace(take, t_s=np.arange(len(index)) / take.rate_hz, sensors=sensors)


def test_a_fidget_is_no_test() -> None:
    take = moving(still(20.0), 800, 830, 0.5)
    phases = [v.phase for v in followed(take, "tug")]
    assert phases == ["get_ready", "ready", "running", "get_ready", "ready"]


def test_a_repetition_drops_what_was() -> None:
    take = pelvis_tug()
    guided = GuidedTest("tug", ("pelvis",), take.rate_hz)
    told(guided, take, 10)
    assert guided.view.phase == "done"
    guided.repeat()
    assert (guided.view.phase, guided.view.result, guided.view.start_s) == ("get_ready", None, None)
    n = len(take.t_s)
    for block in blocks(take, 10):
        guided.push(replace(block, first=block.first + n))
        guided.advance()
    second_view = guided.view
    assert second_view.final
    assert second_view.start_s is not None
    file = measure_tug(follow_trunk(take))
    assert file.start_s is not None
    assert second_view.start_s - n / take.rate_hz == pytest.approx(file.start_s, abs=0.05)
    assert means(second_view.result)["tug_duration_s"] == pytest.approx(
        means(file)["tug_duration_s"], abs=0.05
    )


def test_a_person_corrects_start_and_end() -> None:
    take = pelvis_tug()
    guided = GuidedTest("tug", ("pelvis",), take.rate_hz)
    told(guided, take, 10)
    guided.correct(GivenLimits(3.5, 18.5))
    view = guided.view
    assert view.result is not None
    assert view.result.corrected
    assert means(view.result)["tug_duration_s"] == pytest.approx(15.0)
    file = measure_tug(follow_trunk(take), GivenLimits(3.5, 18.5))
    assert means(view.result) == pytest.approx(means(file), abs=REFINED_S, rel=0.01)


def still(seconds: float, seed: int = 1, *segments: Segment) -> UniformRecording:
    """Person standing with a little sway."""
    n = round(seconds * RATE)
    draw = np.random.default_rng(seed)
    t_s = np.arange(n) / RATE
    sway = 0.05 * np.sin(2.0 * np.pi * 0.4 * t_s)[:, None] * np.array([1.0, 0.0, 0.5])
    base = wear(tug()[0], "pelvis")
    mask = np.ones(n, np.bool_)
    acc = np.array([0.0, GRAVITY, 0.0]) + sway + 0.01 * draw.standard_normal((n, 3))
    x = replace(
        base.sensors["pelvis"], acc=acc, gyr=0.002 * draw.standard_normal((n, 3)), mag=None, valid=mask,
        interpolated=~mask,
    )  # fmt: skip
    sensors = {s: replace(x, device_id=s) for s in segments or ("pelvis",)}
    return replace(base, t_s=t_s, rate_hz=RATE, sensors=sensors)


def moving(take: UniformRecording, low: int, high: int, rate: float) -> UniformRecording:
    """The same with all sensors turning between two samples."""
    sensors = {}
    for s, x in take.sensors.items():
        gyr = x.gyr.copy()
        gyr[low:high] = rate
        sensors[s] = replace(x, gyr=gyr)
    return replace(take, sensors=sensors)


def test_quiet_standing_waits_for_go_and_lasts_thirty_seconds() -> None:
    take = still(50.0)
    guided = GuidedTest("standing_eyes_open", ("pelvis",), RATE)
    phases: list[tuple[str, float]] = []
    for block in blocks(take, 10):
        if block.first == 500:
            assert guided.view.phase == "get_ready"
            guided.go()
        guided.push(block)
        view = guided.advance()
        if not phases or phases[-1][0] != view.phase:
            phases.append((view.phase, view.t_s))
    assert [p for p, _ in phases] == ["get_ready", "ready", "running", "done"] or [p for p, _ in phases] == [
        "get_ready", "running", "done",
    ]  # fmt: skip
    start, end = guided.view.start_s, guided.view.end_s
    assert start is not None
    assert end == pytest.approx(start + 30.0)
    file = measure_sway(take, GivenLimits(start, end))
    assert means(guided.view.result) == pytest.approx(means(file), rel=1e-6)


def test_a_step_begins_quiet_standing_anew() -> None:
    take = moving(still(50.0), 1500, 1580, 2.0)
    guided = GuidedTest("standing_eyes_closed", ("pelvis",), RATE)
    guided.go()
    views = told(guided, take, 10)
    assert "stepped" in [v.problem for v in views]
    assert guided.view.phase == "done"
    assert guided.view.start_s is not None
    assert guided.view.start_s > 15.8


def strides_of_a_walk(start_s: float, end_s: float) -> tuple[list[LiveStride], list[GaitEvent]]:
    """Strides of 1.3 m and 1.1 s of both feet, reported half a second late."""
    strides: list[LiveStride] = []
    events: list[GaitEvent] = []
    for side, lag in zip(SIDES, (0.0, 0.55), strict=True):
        t = start_s + lag
        while t + 1.1 <= end_s:
            events.append(GaitEvent(t, side, "ic", "foot_contact", t + 0.2))
            strides.append(
                LiveStride(
                    len(strides), side, t, t + 0.7, t + 1.1, t + 1.6, {"stride_length_m": 1.3}, {}, {}, 0.0,
                    (), counted=True, complete=True,
                )
            )  # fmt: skip
            t += 1.1
        events.append(GaitEvent(t, side, "ic", "foot_contact", t + 0.2))
    return strides, events


@pytest.mark.slow
@pytest.mark.parametrize(
    ("protocol", "seconds", "name", "expected"),
    [
        ("walk_10m", 13.0, "walk_10m_speed_mps", 1.3 / 1.1),
        ("walk_6min", 365.0, "walk_6min_distance_m", 360.0 * 1.3 / 1.1),
    ],
)
def test_a_walk_ends_by_itself(protocol: Protocol, seconds: float, name: str, expected: float) -> None:
    take = still(5.0 + seconds + 8.0, 1, "foot_l", "foot_r")
    take = moving(take, 500, 500 + round(seconds * RATE), 2.0)
    strides, events = strides_of_a_walk(5.5, 5.0 + seconds)
    guided = GuidedTest(protocol, ("foot_l", "foot_r"), RATE)
    phases: list[str] = []
    for block in blocks(take, 10):
        place = range(block.first, block.first + len(block))
        new = [x for x in strides if round(x.detected_s * RATE) in place]
        guided.push(block, new, [x for x in events if round(x.detected_s * RATE) in place])
        view = guided.advance()
        if not phases or phases[-1] != view.phase:
            phases.append(view.phase)
    assert phases == ["get_ready", "ready", "running", "done"]
    assert means(guided.view.result)[name] == pytest.approx(expected, rel=0.02)


def test_a_test_without_its_sensor_says_so() -> None:
    take = still(5.0)
    guided = GuidedTest("walk_10m", ("pelvis",), RATE)
    views = told(guided, take, 10)
    assert views[-1].problem == "segments_missing"
