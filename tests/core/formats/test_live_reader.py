"""The log of a live take as a recording: what is whole is read, what is odd is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sagittal.core.errors import FormatError, Notice, SagittalError
from sagittal.core.formats import SourceFile, read_recording
from sagittal.core.formats.live_log import (
    FILE_MARK,
    SensorInfo,
    StreamInfo,
    encode_batch,
    finish_json,
    hello_json,
    record,
    scan,
)
from sagittal.core.formats.live_reader import read_live_log
from sagittal.core.signals.recording import Recording
from sagittal.core.timeline import synchronise
from tests.helpers.live import SMALL_HELLO, LiveTake, send, shared, small, small_batch
from tests.helpers.walks import neura_recording


def read(data: bytes) -> Recording:
    return read_recording([SourceFile.of_bytes("monday.sagittal-live", data)])


def codes(notices: tuple[Notice, ...]) -> list[str]:
    return [n.code for n in notices]


def test_a_finished_take_is_a_recording() -> None:
    take = small(4)
    recording = read(take.log())
    assert recording.notices == ()
    assert dict(recording.segments) == {"A1": "foot_l", "ö 2": None}
    stream = recording.streams["A1"]
    assert (stream.clock, stream.rate_hz, stream.source) == ("device", 100.0, "monday.sagittal-live")
    assert stream.mag is None
    assert stream.gyr is not None
    assert np.allclose(stream.t_s, np.arange(20) * 0.01, atol=1e-12)
    sent = np.concatenate([b.samples for b in take.batches])
    assert np.array_equal(stream.acc, sent[:, 0, :3].astype(np.float64))
    assert np.array_equal(stream.gyr, sent[:, 0, 3:6].astype(np.float64))


@pytest.mark.recorded
def test_neura_walk_streamed_is_neura_walk_uploaded() -> None:
    uploaded, streamed = neura_recording(), read(send([shared(neura_recording())]).log())
    a, b = synchronise(uploaded), synchronise(streamed)
    assert a.sensors.keys() == b.sensors.keys()
    assert np.allclose(a.t_s, b.t_s, atol=1e-9)
    for segment, signals in a.sensors.items():
        assert np.array_equal(signals.acc.astype(np.float32), b.sensors[segment].acc)
        assert np.array_equal(signals.gyr.astype(np.float32), b.sensors[segment].gyr)
        assert np.array_equal(signals.valid, b.sensors[segment].valid)


@pytest.mark.slow
def test_a_take_cut_at_every_byte_is_read_or_refused_with_its_reason() -> None:
    take = small()
    log = take.log()
    for n in range(len(log)):
        if not any(r.kind == "B" for r in scan(log[:n])[0]):
            with pytest.raises(FormatError) as caught:
                read_live_log(log[:n], "x")
            assert caught.value.code in ("bad_live_log", "empty")
            continue
        recording = read_live_log(log[:n], "x")
        batches = len(recording.streams["A1"].t_s) // 5
        torn = scan(log[:n])[1] != n
        assert codes(recording.notices) == ["live_log_torn"] * torn + ["live_unfinished"]
        assert sum(r.kind == "B" for r in scan(log[:n])[0]) == batches


def test_other_files_are_not_taken_for_one_and_one_is_not_taken_for_others() -> None:
    with pytest.raises(FormatError) as cut:
        read(FILE_MARK[:-1])
    assert cut.value.code == "unknown_format"
    with pytest.raises(FormatError) as headless:
        read(FILE_MARK)
    assert headless.value.code == "bad_live_log"
    with pytest.raises(FormatError) as several:
        read_recording([SourceFile.of_bytes(n, small().log()) for n in ("a", "b")])
    assert several.value.code == "several_recordings"


def test_a_count_or_hash_that_differs_is_told() -> None:
    take = small()
    body = take.log(finished=False)
    other = replace(take.finish(), sha256="0" * 64)
    assert codes(read(body + record("F", finish_json(other))).notices) == ["live_hash_mismatch"]
    more = replace(take.finish(), count=9)
    assert codes(read(body + record("F", finish_json(more))).notices) == ["live_count_mismatch"]


@pytest.mark.parametrize(
    "strange",
    [
        record("B", encode_batch(small_batch(7))),
        record("B", encode_batch(replace(small_batch(2), stream=9))),
        record("B", encode_batch(replace(small_batch(2), samples=np.zeros((5, 3, 9), np.float32)))),
        record("B", b"no frame"),
        record("H", hello_json(SMALL_HELLO)),
        record("F", b"{}"),
    ],
)
def test_a_record_that_does_not_belong_there_ends_the_take(strange: bytes) -> None:
    body = small(2).log(finished=False)
    recording = read(body + strange + record("B", encode_batch(small_batch(2))))
    assert codes(recording.notices) == ["live_log_torn", "live_unfinished"]
    assert len(recording.streams["A1"].t_s) == 10


def test_values_that_are_no_numbers_are_kept_as_missing_and_counted() -> None:
    first = small_batch()
    samples = first.samples.copy()
    samples[1, 0, 2] = np.inf
    samples[3, 0, 4] = np.nan
    samples[:, 1] = np.nan
    recording = read(LiveTake(SMALL_HELLO, (replace(first, samples=samples),)).log())
    stream = recording.streams["A1"]
    assert codes(stream.notices) == ["not_finite", "samples_missing"]
    assert np.isnan(stream.acc[1, 2])
    assert stream.gyr is not None
    assert np.isnan(stream.gyr[3, 1])
    assert "ö 2" not in recording.streams
    assert codes(recording.notices) == ["sensor_missing"]


def test_a_sensor_without_rates_is_said() -> None:
    first = small_batch(n=20)
    samples = first.samples.copy()
    samples[:, 0, 3:] = np.nan
    stream = read(LiveTake(SMALL_HELLO, (replace(first, samples=samples),)).log()).streams["A1"]
    assert stream.gyr is None
    assert codes(stream.notices) == ["missing_gyro"]


def test_a_stream_that_sent_nothing_is_said() -> None:
    other = StreamInfo(5, 60.0, "own", (SensorInfo("B1", "foot_r"),))
    recording = read(
        replace(small(), hello=replace(SMALL_HELLO, streams=(*SMALL_HELLO.streams, other))).log()
    )
    assert codes(recording.notices) == ["sensor_missing", "clocks_aligned"]
    assert "B1" not in recording.segments


def test_samples_that_run_backwards_are_left_out() -> None:
    batches = [small_batch(0), replace(small_batch(1), t0_us=small_batch(0).t0_us), small_batch(2)]
    recording = read(LiveTake(SMALL_HELLO, tuple(batches)).log())
    assert codes(recording.notices) == ["out_of_order"]
    assert recording.notices[0].severity == "error"
    assert len(recording.streams["A1"].t_s) == 10


def test_a_manifest_may_say_otherwise_where_the_sensors_were() -> None:
    manifest = SourceFile.of_bytes("manifest.json", b'{"sensors": {"A1": "shank_r", "\xc3\xb6 2": "pelvis"}}')
    recording = read_recording([SourceFile.of_bytes("take", small().log()), manifest])
    assert dict(recording.segments) == {"A1": "shank_r", "ö 2": "pelvis"}


@given(st.integers(0, 10_000), st.binary(min_size=1, max_size=8))
def test_a_log_that_was_written_over_is_read_or_refused(at: int, junk: bytes) -> None:
    log = bytearray(small().log())
    at %= len(log)
    log[at : at + len(junk)] = junk
    refused = ""
    try:
        read(bytes(log))
    except SagittalError as error:
        refused = error.code
    assert refused in ("", "bad_live_log", "empty", "unknown_format", "unsupported_format", "zip_bad")
