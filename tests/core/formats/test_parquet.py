"""Our own recording file: exact to float32, and safe against damage."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sagittal.core.errors import FormatError, Notice
from sagittal.core.formats import SourceFile, read_recording, write_recording
from sagittal.core.formats.manifest import manifest_of
from sagittal.core.quality import describe
from sagittal.core.signals.recording import ImuStream, Recording, Subject
from sagittal.core.subject.shoe import Shoe
from tests.core.formats.making import mt_file, signals, source, stream


def back(recording: Recording) -> Recording:
    return read_recording([SourceFile.of_bytes("take.parquet", write_recording(recording))])


def test_a_file_of_squats_that_is_declared_a_walk_says_so() -> None:
    squats = replace(read_recording([mt_file()]), protocol="squat")
    stored = [source("recording.parquet", write_recording(squats))]
    codes = {
        declared: [n.code for n in read_recording(stored, manifest_of({"protocol": declared})).notices]
        for declared in ("walk", "squat")
    }
    assert "protocol_differs" in codes["walk"]
    assert "protocol_differs" not in codes["squat"]


def test_everything_that_was_known_comes_back() -> None:
    acc, gyr = signals(50)
    s = stream("a.b c", acc, gyr, mag=acc / 10, quat=np.tile([1.0, 0, 0, 0], (50, 1)))
    recording = Recording(
        {"a.b c": s, "two": stream("two", acc + 1, None)},
        {"a.b c": "pelvis", "two": None},
        Subject(1.7, 0.2, {"knee_flexion_l": 8.0}, Shoe(0.06, 0.2, 0.015)),
        "treadmill",
        {"pelvis": "sacrum, face backwards"},
        {"x.txt": "abc"},
        (Notice("n", "said 🦶", "two", 1.5, "info"),),
    )
    again = back(recording)
    assert again.subject == recording.subject
    assert again.protocol == "treadmill"
    assert dict(again.segments) == dict(recording.segments)
    assert dict(again.mounting) == dict(recording.mounting)
    assert again.sha256["x.txt"] == "abc"
    assert again.notices == recording.notices
    assert again.streams["two"].gyr is None
    assert write_recording(again) == write_recording(again)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    n=st.integers(1, 60),
    m=st.integers(1, 60),
    offset=st.integers(0, 80),
    rate=st.sampled_from([60.0, 100.0, 204.8, 512.0]),
    seed=st.integers(0, 2**31),
    holes=st.booleans(),
)
def test_streams_of_any_length_and_rate_come_back_exact(
    n: int, m: int, offset: int, rate: float, seed: int, holes: bool
) -> None:
    rng = np.random.default_rng(seed)

    def made(device: str, k: int, start: float, hz: float) -> ImuStream:
        acc = rng.normal(0, 10, (k, 3)).astype(np.float32).astype(np.float64)
        if holes:
            # the first sample stays: a stream without one is left out
            acc[1:][rng.random((k - 1, 3)) < 0.2] = np.nan
        return stream(device, acc, acc[:, ::-1].copy(), t_s=start + np.arange(k) / hz, rate_hz=hz)

    streams = {"a": made("a", n, 0.0, rate), "b": made("b", m, offset / 100, 100.0)}
    again = back(Recording(streams, {}))
    for device, s in streams.items():
        got = again.streams[device]
        np.testing.assert_array_equal(got.acc, s.acc)
        np.testing.assert_array_equal(got.gyr, s.gyr)
        np.testing.assert_allclose(got.t_s, s.t_s, atol=5.1e-7)
        assert (got.digest, got.rate_hz, got.clock) == (s.digest, s.rate_hz, s.clock)


def test_the_columns_are_stored_as_the_specification_says() -> None:
    data = write_recording(read_recording([mt_file(), mt_file("00B40C44", seed=1)]))
    file = pq.ParquetFile(pa.BufferReader(data))
    assert file.schema_arrow.field("t_us").type == pa.int64()
    assert file.schema_arrow.field("00B40B91.gyr_z").type == pa.float32()
    column = file.metadata.row_group(0).column(1)
    assert column.compression == "ZSTD"
    assert "BYTE_STREAM_SPLIT" in column.encodings
    assert "PLAIN_DICTIONARY" not in column.encodings
    assert "RLE_DICTIONARY" not in column.encodings


def test_a_column_may_be_null_only_where_its_sensor_has_holes() -> None:
    acc, gyr = signals(50)
    late = stream("late", acc[:40], gyr[:40], t_s=0.1 + np.arange(40) / 100.0)
    data = write_recording(Recording({"whole": stream("whole", acc, gyr), "late": late}, {}))
    fields = pq.read_schema(pa.BufferReader(data))
    assert {name: fields.field(name).nullable for name in ("t_us", "whole.acc_x", "late.gyr_z")} == {
        "t_us": False,
        "whole.acc_x": False,
        "late.gyr_z": True,
    }


@pytest.mark.slow
def test_many_sensors_with_and_without_holes_keep_their_own_samples() -> None:
    """More than fit into one piece of memory, and some that are read into an array of their own."""
    n, rng = 20_000, np.random.default_rng(0)
    streams = {}
    for i in range(40):
        t = np.arange(n - 100 * (i % 3 == 0)) / 100.0
        acc = rng.normal(0, 10, (len(t), 3)).astype(np.float32).astype(np.float64)
        streams[f"s{i}"] = stream(f"s{i}", acc, acc[::-1].copy(), t_s=t)
    again = back(Recording(streams, {})).streams
    for device, s in streams.items():
        np.testing.assert_array_equal(again[device].acc, s.acc)
        np.testing.assert_array_equal(again[device].gyr, s.gyr)
        assert again[device].digest == s.digest
    assert len({s.digest for s in again.values()}) == 40


def test_a_foreign_and_a_damaged_file_are_refused() -> None:
    out = pa.BufferOutputStream()
    pq.write_table(pa.table({"x": [1.0, 2.0]}), out)
    with pytest.raises(FormatError) as e:
        read_recording([SourceFile.of_bytes("x.parquet", out.getvalue().to_pybytes())])
    assert e.value.code == "foreign_parquet"
    data = write_recording(read_recording([mt_file()]))
    for cut in range(5, len(data), max(1, len(data) // 40)):
        with pytest.raises(FormatError) as e:
            read_recording([SourceFile.of_bytes("x.parquet", data[:cut])])
        assert e.value.code == "bad_parquet"


def test_a_stored_take_is_uploaded_alone() -> None:
    stored = SourceFile.of_bytes("x.parquet", write_recording(read_recording([mt_file()])))
    with pytest.raises(FormatError) as e:
        read_recording([stored, mt_file("00B40C44")])
    assert e.value.code == "several_recordings"


def changed(data: bytes, columns: dict[str, float], meta: dict[str, str] | None = None) -> SourceFile:
    """The same file, whole columns set to one value, parts of its metadata to raw JSON."""
    table = pq.read_table(pa.BufferReader(data))
    for name, value in columns.items():
        column = pa.array(np.full(len(table), value, np.float32))
        table = table.set_column(table.column_names.index(name), name, column)
    known = json.loads(table.schema.metadata[b"sagittal.recording"])
    text = json.dumps({**known, **{key: f"@{key}@" for key in meta or {}}})
    for key, raw in (meta or {}).items():
        text = text.replace(f'"@{key}@"', raw)
    sink = pa.BufferOutputStream()
    pq.write_table(table.replace_schema_metadata({b"sagittal.recording": text.encode()}), sink)
    return SourceFile.of_bytes("take.parquet", bytes(sink.getvalue().to_pybytes()))


def two_sensors() -> bytes:
    acc, gyr = signals(1000, still=400)
    return write_recording(
        Recording(
            {"a": stream("a", acc, gyr), "b": stream("b", acc + 1, gyr)}, {"a": "foot_l", "b": "foot_r"}
        )
    )


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf], ids=str)
def test_a_sensor_without_one_number_is_left_out_with_a_sentence(value: float) -> None:
    found = read_recording([changed(two_sensors(), {"a.acc_y": value})])
    assert tuple(found.streams) == ("b",)
    assert ("sensor_missing", "a") in [(n.code, n.sensor) for n in found.notices]
    describe(found).to_json()


@pytest.mark.parametrize("value", [np.nan, np.inf], ids=str)
def test_a_gyroscope_without_one_number_counts_as_none(value: float) -> None:
    found = read_recording([changed(two_sensors(), {"a.gyr_x": value})])
    assert found.streams["a"].gyr is None
    assert "missing_gyro" in [n.code for n in found.streams["a"].notices]
    assert json.dumps(describe(found).to_json(), allow_nan=False)


def test_a_file_without_one_number_is_refused_with_a_sentence() -> None:
    with pytest.raises(FormatError, match="measured anything") as caught:
        read_recording([changed(two_sensors(), {"a.acc_x": np.nan, "b.acc_z": np.inf})])
    assert caught.value.code == "no_signal"


@pytest.mark.slow
@pytest.mark.parametrize("key", ["subject", "mounting", "notices", "sha256", "sensors", "protocol"])
@pytest.mark.parametrize("ends", ["[]", "{}"])
@pytest.mark.parametrize("depth", [50, 900, 20_000])
def test_metadata_nested_without_end_is_refused_with_a_sentence(depth: int, ends: str, key: str) -> None:
    deep = "[" * depth + "]" * depth if ends == "[]" else '{"a":' * depth + "1" + "}" * depth
    with pytest.raises(FormatError) as caught:
        read_recording([changed(two_sensors(), {}, {key: deep})])
    assert caught.value.code == "bad_parquet"
    assert len(caught.value.message) < 200
