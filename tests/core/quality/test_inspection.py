"""Content of an upload by sensor, before any mapping."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.quality.inspection import LOOKED_AT_S, describe, measure_losses
from sagittal.core.quality.suggestion import Suggestion
from sagittal.core.signals.recording import Recording
from sagittal.core.signals.sample_blocks import LongStream, SampleBlock
from sagittal.core.simulate import simulate_scenario
from tests.core.formats.making import signals, stream

ACC, GYR = signals(600, still=300)


@pytest.mark.recorded
def test_the_upload_page_learns_what_the_real_files_hold(neura: Recording) -> None:
    unmapped = Recording(neura.streams, {})
    description = describe(unmapped)
    text = json.dumps(description.to_json(), allow_nan=False)
    assert "NaN" not in text
    copies = {d.device_id: d.duplicate_of for d in description.devices if d.duplicate_of}
    assert copies == {"00B40C49": "00B40C44", "00B40C4A": "00B40C47"}
    assert all(
        d.lost_pct == 0.0 and d.has_gyro and d.has_mag and d.rate_hz == 100.0 for d in description.devices
    )
    assert description.duration_s == pytest.approx(25.02)


@pytest.mark.slow
@pytest.mark.parametrize("until_s", [6.0, np.inf], ids=["before the walk", "all the time"])
def test_a_pelvis_without_any_acceleration_is_described_all_the_same(until_s: float) -> None:
    """Which leg is the left one is read from the pelvis."""
    recording = simulate_scenario("comfortable", 0).recording
    streams = {}
    for i, (device, segment) in enumerate(recording.segments.items()):
        s = recording.streams[device]
        none = (s.t_s < until_s) & (segment == "pelvis")
        acc = np.where(none[:, None], 0.0, s.acc)
        streams[f"s{i}"] = replace(s, device_id=f"s{i}", source="x", acc=acc)
    description = describe(Recording(streams, {}))
    assert "gravity_removed" in [n.code for d in description.devices for n in d.notices]
    assert json.dumps(description.to_json(), allow_nan=False)


def test_losses_are_counted_between_the_first_and_the_last_sample() -> None:
    assert measure_losses(stream("a", ACC, GYR)) == (0.0, 0.0)
    stored_response = np.delete(np.arange(600), np.arange(200, 230))
    share, longest = measure_losses(
        stream("a", ACC[stored_response], GYR[stored_response], t_s=stored_response / 100.0)
    )
    assert share == pytest.approx(30 / 600)
    assert longest == pytest.approx(0.3)
    # a row without its rate is lost as a packet is; half a sample of jitter is no hole
    gyr = GYR.copy()
    gyr[200:230, 1] = np.nan
    assert measure_losses(stream("a", ACC, gyr)) == pytest.approx((30 / 600, 0.3))
    t_s = np.arange(600) / 100.0
    t_s[300:] += 0.004
    assert measure_losses(stream("a", ACC, GYR, t_s=t_s)) == (0.0, 0.0)


def test_without_a_whole_sample_all_is_lost_and_a_single_one_has_no_hole() -> None:
    none = np.full((5, 3), np.nan)
    assert measure_losses(stream("a", none, None)) == (1.0, 0.0)
    one = none.copy()
    one[0] = 1.0
    assert measure_losses(stream("a", one, None)) == (0.0, 0.0)


def test_a_copy_is_told_with_the_original_and_times_are_of_the_whole_upload() -> None:
    t_s = np.arange(600) / 100.0
    devices = [stream("a", ACC, GYR, t_s=t_s + 1.0), stream("b", ACC + 1.0, None, t_s=t_s + 3.0)]
    copy = replace(devices[0], device_id="c")
    description = describe(Recording({x.device_id: x for x in (*devices, copy)}, {"a": None, "b": "pelvis"}))
    a, b, c = description.devices
    assert description.duration_s == pytest.approx(7.99)
    assert (a.start_s, b.start_s) == (1.0, 3.0)
    assert a.duration_s == pytest.approx(5.99)
    assert (a.duplicate_of, b.duplicate_of, c.duplicate_of) == (None, None, "a")
    assert [n.code for n in c.notices] == ["duplicate_stream"]
    assert (a.declared, b.declared, c.declared) == (True, True, False)
    assert (a.segment, b.segment, c.segment) == (None, "pelvis", None)
    assert (a.has_gyro, b.has_gyro, a.has_mag, a.has_orientation) == (True, False, False, False)
    notices = description.to_json()["devices"]
    assert isinstance(notices, list)
    assert [d["units"]["gyr"] for d in notices] == ["rad/s", None, "rad/s"]
    assert [d["basis"] for d in notices] == ["declared", "declared", None]


def test_a_recording_of_hours_is_described_by_its_first_minutes() -> None:
    opened: list[float] = []

    def blocks() -> Iterator[SampleBlock]:
        for k in range(5):
            opened.append(k)
            t_s = 400.0 * k + np.arange(4000) / 10.0
            lost = t_s != 100.0
            acc = np.tile([0.0, 9.81, 0.0], (4000, 1))
            yield SampleBlock(t_s[lost], acc[lost], None)

    long = LongStream("day_chest", "day.cwa", 10.0, False, 2000.0, blocks)
    (device,) = describe(Recording({}, {}, long={"day_chest": long})).devices
    # the block that goes beyond ten minutes is the last one read
    assert len(opened) == int(LOOKED_AT_S // 400.0) + 1
    assert device.samples == 20_000
    assert device.duration_s == 2000.0
    assert device.still_norm == pytest.approx(9.81)
    assert device.longest_gap_s == pytest.approx(0.1)
    assert device.lost_pct == pytest.approx(100.0 * 0.1 / 799.9)
    assert device.suggestion == Suggestion("chest", "label")
    assert [(n.code, n.severity) for n in device.notices] == [("read_in_blocks", "info")]
