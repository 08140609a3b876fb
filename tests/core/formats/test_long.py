"""Recordings that are read block by block are those that are read at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.errors import ManifestError, SignalError
from sagittal.core.formats import SourceFile, manifest_of, read_recording, reader, table, write_recording
from sagittal.core.quality import describe
from sagittal.core.signals.recording import Recording
from sagittal.core.signals.sample_blocks import LongStream
from sagittal.core.simulate.daily import DailyItem, record_daily_life, simulate_daily_life
from sagittal.core.timeline import synchronise

SPEC = {
    "file": "*.csv", "time_column": "t", "time_unit": "ms", "acc_unit": "g",
    "columns": {"chest": {"acc": ["x", "y", "z"]}},
}  # fmt: skip


@pytest.fixture(autouse=True)
def few_rows_are_many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "MOST_ROWS_ALONE", 500)
    monkeypatch.setattr(table, "_CHUNK", 4096)


@pytest.fixture(scope="module")
def recording() -> Recording:
    plan = (DailyItem("stand", 8.0), DailyItem("walk", 10.0), DailyItem("stand", 5.0))
    return record_daily_life(simulate_daily_life(plan, seed=1, has_gyro=True))


def samples(stream: LongStream) -> tuple[np.ndarray, np.ndarray]:
    blocks = list(stream.open_blocks())
    return tuple(np.concatenate([getattr(b, n) for b in blocks]) for n in ("t_s", "acc"))  # type: ignore[return-value]


def csv_text(recording: Recording) -> bytes:
    (stream,) = recording.streams.values()
    rows = [
        f"{1000 * t:.3f},{a[0]:.6f},{a[1]:.6f},{a[2]:.6f}"
        for t, a in zip(stream.t_s, stream.acc / 9.80665, strict=True)
    ]
    return "\n".join(("t,x,y,z", *rows, "")).encode()


def test_a_long_table_gives_its_samples_piece_by_piece(recording: Recording) -> None:
    manifest = manifest_of({"sources": [SPEC], "protocol": "activity"})
    found = read_recording([SourceFile.of_bytes("day.csv", csv_text(recording))], manifest)
    (stream,) = recording.streams.values()
    t_s, acc = samples(found.long["chest"])
    assert not found.streams
    assert found.segments == {"chest": "chest"}
    assert t_s == pytest.approx(stream.t_s, abs=1e-6)
    assert acc == pytest.approx(stream.acc, abs=1e-4)
    assert found.long["chest"].rate_hz == pytest.approx(50.0, rel=1e-3)
    assert found.long["chest"].duration_s == pytest.approx(stream.t_s[-1], abs=0.1)


def test_a_long_stored_recording_is_opened_not_read(recording: Recording) -> None:
    found = read_recording([SourceFile.of_bytes("day.parquet", write_recording(recording))])
    (stream,) = recording.streams.values()
    t_s, acc = samples(found.long[stream.device_id])
    assert not found.streams
    assert (found.protocol, found.subject) == ("activity", recording.subject)
    assert t_s == pytest.approx(stream.t_s, abs=1e-6)
    assert acc == pytest.approx(stream.acc, abs=1e-5)


def test_the_upload_page_is_told_what_such_a_file_is(recording: Recording) -> None:
    found = read_recording([SourceFile.of_bytes("day.parquet", write_recording(recording))])
    (device,) = describe(found).devices
    assert device.duration_s == pytest.approx(23.0, abs=0.1)
    assert [n.code for n in device.notices] == ["read_in_blocks"]


def test_another_protocol_says_that_it_is_too_long(recording: Recording) -> None:
    found = read_recording(
        [SourceFile.of_bytes("day.parquet", write_recording(recording))], manifest_of({"protocol": "walk"})
    )
    with pytest.raises(SignalError, match="too long for the protocol 'walk'") as error:
        synchronise(found)
    assert error.value.code == "recording_too_long"


def test_a_sensor_that_is_too_long_is_not_left_out_beside_a_short_one(recording: Recording) -> None:
    found = read_recording(
        [SourceFile.of_bytes("day.parquet", write_recording(recording))], manifest_of({"protocol": "walk"})
    )
    ((worn, segment),) = recording.segments.items()
    short = replace(recording.streams[worn], device_id="short")
    both = replace(found, streams={"short": short}, segments={worn: segment, "short": "pelvis"})
    with pytest.raises(SignalError, match=f"“{worn}” is too long") as error:
        synchronise(both)
    assert error.value.code == "recording_too_long"


def test_two_files_of_one_sensor_each_are_as_long_as_one_file_of_two(recording: Recording) -> None:
    feet = ("left_foot", "right_foot")
    specs = [{**SPEC, "file": f"{foot}.csv", "columns": {foot: {"acc": ["x", "y", "z"]}}} for foot in feet]
    day = csv_text(recording)
    files = [SourceFile.of_bytes(f"{foot}.csv", day) for foot in feet]
    found = read_recording(files, manifest_of({"sources": specs}))
    assert (set(found.streams), found.long) == ({"left_foot", "right_foot"}, {})
    alone = read_recording(files[:1], manifest_of({"sources": specs[:1]}))
    assert (set(alone.long), alone.streams) == ({"left_foot"}, {})


def test_a_counter_cannot_time_a_long_table(recording: Recording) -> None:
    spec = {**SPEC, "counter": {"column": "t", "rate_hz": 50}}
    del spec["time_column"], spec["time_unit"]
    with pytest.raises(ManifestError, match="give time_column or rate_hz") as error:
        read_recording(
            [SourceFile.of_bytes("day.csv", csv_text(recording))], manifest_of({"sources": [spec]})
        )
    assert error.value.code == "counter_too_long"
