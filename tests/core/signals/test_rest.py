"""Rest is found wherever it is, for all sensors together and for each alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view

from sagittal.core.frames import Floats
from sagittal.core.pipeline import analyse
from sagittal.core.signals.recording import SensorSignals, Subject, UniformRecording
from sagittal.core.signals.rest import (
    RestParams,
    count_runs,
    drop_false_rests,
    find_rest_windows,
    find_runs,
    index_window,
    measure_quietness,
)
from tests.data import data_folder
from tests.helpers.real_takes import analyse_take, read_take
from tests.helpers.walks import lost, neura_walk

RATE = 100.0


def still(n: int, bias: Floats | None = None, seed: int = 0) -> SensorSignals:
    rng = np.random.default_rng(seed)
    acc = np.array([0.0, 9.81, 0.0]) + 0.02 * rng.standard_normal((n, 3))
    gyr = (np.zeros(3) if bias is None else bias) + 0.005 * rng.standard_normal((n, 3))
    return SensorSignals("s", acc, gyr, None, np.ones(n, bool), np.zeros(n, bool))


def with_walk(signals: SensorSignals, start_s: float, end_s: float) -> SensorSignals:
    gyr = signals.gyr.copy()
    part = slice(round(start_s * RATE), round(end_s * RATE))
    t = np.arange(part.stop - part.start) / RATE
    gyr[part, 2] += 3.0 * np.sin(2 * np.pi * t)
    return replace(signals, gyr=gyr)


def take(**sensors: SensorSignals) -> UniformRecording:
    n = len(next(iter(sensors.values())).acc)
    return UniformRecording(np.arange(n) / RATE, RATE, sensors, Subject(), "walk", {})  # type: ignore[arg-type]


def test_runs_are_counted_across_blocks() -> None:
    mask = np.array([[1, 0], [1, 1], [0, 1], [1, 1], [1, 0], [1, 1]], np.bool_)
    expected = [[1, 0], [2, 1], [0, 2], [1, 3], [2, 0], [3, 1]]
    for size in (1, 2, 4, 6):
        before = np.zeros(2, np.int64)
        found = [count_runs(mask[k : k + size], before) for k in range(0, len(mask), size)]
        assert np.concatenate(found).tolist() == expected
        assert count_runs(mask[:0], before).shape == (0, 2)
        assert before.tolist() == expected[-1]


@pytest.mark.parametrize(("start", "end"), [(5.0, 20.0), (0.0, 15.0), (3.0, 17.0)])
def test_rest_is_found_first_later_or_at_the_end(start: float, end: float) -> None:
    found = find_rest_windows(take(foot_l=with_walk(still(2000), start, end)))
    assert len(found) == (start > 0) + (end < 20)
    for a, b in found:
        assert b <= start + 0.3 or a >= end - 0.3


def test_a_gyro_offset_is_not_movement() -> None:
    offset = np.radians([1.8, -1.2, 2.5])
    assert find_rest_windows(take(foot_l=still(500, offset))) == ((0.0, 5.0),)


@pytest.mark.parametrize("deg_s", [7.0, 12.0, 19.0])
def test_a_large_gyro_offset_is_not_movement_where_gravity_stays(deg_s: float) -> None:
    offset = np.radians(deg_s) * np.array([0.8, 0.2, -0.566])
    assert find_rest_windows(take(foot_l=still(500, offset))) == ((0.0, 5.0),)
    plain, biased = (
        find_rest_windows(take(foot_l=with_walk(still(2000, b), 5.0, 15.0))) for b in (None, offset)
    )
    assert np.abs(np.subtract(plain, biased)).max() < 0.05


def test_an_offset_about_the_vertical_must_recur() -> None:
    offset = np.radians([0.0, 12.0, 0.0])
    assert len(find_rest_windows(take(foot_l=with_walk(still(2000, offset), 5.0, 15.0)))) == 2
    turned_once = with_walk(still(2000, offset), 5.0, 20.0)
    assert find_rest_windows(take(foot_l=turned_once)) == ()


@pytest.mark.parametrize("deg_s", [7.0, 12.0, 19.0])
def test_a_slow_turn_about_a_horizontal_axis_is_no_offset(deg_s: float) -> None:
    rest = still(500, np.radians([deg_s, 0.0, 0.0]))
    angle = np.radians(deg_s) * np.arange(500) / RATE
    turned = np.column_stack([np.zeros(500), 9.81 * np.cos(angle), -9.81 * np.sin(angle)])
    assert find_rest_windows(take(foot_l=replace(rest, acc=rest.acc + turned - [0.0, 9.81, 0.0]))) == ()


def test_beyond_any_data_sheet_a_steady_rate_is_a_turn() -> None:
    assert find_rest_windows(take(foot_l=still(500, np.radians([16.0, 0.0, -16.0])))) == ()


@pytest.mark.recorded
@pytest.mark.parametrize("deg_s", [6.5, 8.3, 15.0])
@pytest.mark.parametrize("segment", ["foot_l", "pelvis"])
def test_a_walk_with_a_biased_gyroscope_is_the_walk(segment: str, deg_s: float) -> None:
    """A real cheap gyroscope had 8.5 °/s: its foot was never at rest and lost every stride."""
    recording = read_take("11-1")
    offset = np.radians(deg_s) * np.array([0.6, -0.5, 0.62])
    streams = {
        name: replace(stream, gyr=stream.gyr + offset) if recording.segments[name] == segment else stream
        for name, stream in recording.streams.items()
    }
    plain, biased = analyse_take("11-1"), analyse(replace(recording, streams=streams))
    assert plain.strides
    assert biased.strides
    edges = [[(s.start_s, s.end_s) for s in x.strides] for x in (plain.strides, biased.strides)]
    assert np.abs(np.array(edges[0]) - np.array(edges[1])).max() < 0.005
    assert {n.code for n in biased.notices} == {n.code for n in plain.notices}


def test_a_steady_turn_above_the_limit_is_not_rest() -> None:
    assert find_rest_windows(take(foot_l=still(500, np.radians([0.0, 12.0, 0.0])))) == ()


def test_rest_of_a_take_is_the_rest_of_all_its_sensors() -> None:
    recording = take(
        foot_l=with_walk(still(2000), 5.0, 12.0), foot_r=with_walk(still(2000, seed=1), 7.0, 15.0)
    )
    (_, first_end), (second_start, _) = find_rest_windows(recording)
    assert first_end == pytest.approx(4.8, abs=0.3)
    assert second_start == pytest.approx(15.2, abs=0.3)
    assert find_rest_windows(recording, segments=["foot_r"])[0][1] == pytest.approx(6.8, abs=0.3)


@pytest.mark.parametrize("width", [2, 50, 99, 100, 400])
def test_quietness_is_of_the_window_around_each_sample(width: int) -> None:
    signals, n = with_walk(still(400, np.radians([1.0, 2.0, -1.0])), 1.0, 2.0), 400
    signals = replace(signals, valid=np.arange(n) != 300)
    found = measure_quietness(signals, RATE, RestParams(window_s=width / RATE))
    windows = sliding_window_view(signals.gyr, width, axis=0)
    whole = np.asarray(sliding_window_view(signals.valid, width).all(axis=1))
    spread = np.where(whole, windows.var(axis=2).sum(axis=1), np.inf)
    offset = windows[np.argmin(spread)].mean(axis=1)
    rate = sliding_window_view(np.linalg.norm(signals.gyr - offset, axis=1), width)
    force = sliding_window_view(np.linalg.norm(signals.acc, axis=1), width)
    at = np.clip(np.arange(n) - width // 2, 0, n - width)
    np.testing.assert_allclose(found.gyro, rate.mean(axis=1)[at], atol=1e-9)
    np.testing.assert_allclose(found.acc, force.std(axis=1)[at], atol=1e-6)
    calm = (found.gyro < RestParams.gyro_limit) & (found.acc < RestParams.acc_std_limit)
    np.testing.assert_array_equal(found.quiet, calm & whole[at])


def test_a_lost_sensor_does_not_rest() -> None:
    recording = lost(take(foot_l=still(1000)), "foot_l", 4.0, 6.0)
    (_, end), (start, _) = find_rest_windows(recording)
    assert end <= 4.0
    assert start >= 6.0


def test_a_take_shorter_than_a_window_has_no_rest() -> None:
    assert find_rest_windows(take(foot_l=still(60))) == ()
    assert not measure_quietness(still(60), RATE).quiet.any()


def test_shortest_rest_is_respected() -> None:
    recording = take(foot_l=with_walk(still(1000), 2.0, 10.0))
    assert len(find_rest_windows(recording)) == 1
    assert find_rest_windows(recording, RestParams(shortest_s=3.0)) == ()


@pytest.mark.parametrize(("degrees", "seconds", "kept"), [(0.5, 2.0, 1), (4.0, 2.0, 0), (4.0, 8.0, 1)])
def test_a_rest_in_which_the_vertical_turns_fast_is_a_slow_movement(
    degrees: float, seconds: float, kept: int
) -> None:
    """Four degrees in two seconds are 2 °/s that a mean would take for a bias; in eight they are little."""
    n = round(seconds * RATE)
    lean = np.radians(degrees) * np.linspace(0.0, 1.0, n)
    quiet = still(n)
    acc = 9.81 * np.stack((np.sin(lean), np.cos(lean), np.zeros(n)), axis=1)
    recording = take(foot_l=replace(quiet, acc=acc))
    assert len(drop_false_rests(recording, ((0.0, seconds),))) == kept


def test_runs_and_samples_are_half_open() -> None:
    assert find_runs(np.array([True, True, False, True])) == [(0, 2), (3, 4)]
    assert find_runs(np.zeros(3, bool)) == []
    assert index_window((1.0, 2.5), RATE) == slice(100, 250)


@pytest.mark.recorded
def test_neura_walk_stands_before_and_after_its_walk() -> None:
    data_folder("neura_walk")
    (a, b), (c, d) = find_rest_windows(neura_walk())
    assert a == 0.0
    assert 10.5 < b < 11.3
    assert 21.0 < c < 22.0
    assert d == pytest.approx(25.03)
