"""The live protocol's batches and log: each comes back as it was, nothing that is not one gets through."""

from __future__ import annotations

import json
import struct
import tracemalloc
from dataclasses import replace
from zlib import crc32

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sagittal.core.errors import InputError
from sagittal.core.formats.live_log import (
    FILE_MARK,
    MOST_FRAME_BYTES,
    SampleBatch,
    batch_of_json,
    check_fits,
    decode_batch,
    encode_batch,
    parse_finish,
    parse_hello,
    read_batch_header,
    record,
    scan,
    scan_records,
    view_samples,
)
from tests.helpers.live import SMALL_HELLO, small, small_batch


def refused(frame: bytes) -> str:
    with pytest.raises(InputError) as caught:
        decode_batch(frame)
    return caught.value.code


def sealed(frame: bytearray) -> bytes:
    """A frame whose checksum is right whatever else is not."""
    frame[-4:] = struct.pack("<I", crc32(frame[:-4]))
    return bytes(frame)


def same(a: SampleBatch, b: SampleBatch) -> bool:
    head = (a.stream, a.seq, a.t0_us, a.sent_us) == (b.stream, b.seq, b.t0_us, b.sent_us)
    offsets = (a.offsets_us is None) == (b.offsets_us is None) and (
        a.offsets_us is None or b.offsets_us is None or bool((a.offsets_us == b.offsets_us).all())
    )
    return head and offsets and a.samples.tobytes() == b.samples.tobytes()


def test_the_bytes_are_those_that_the_protocol_names() -> None:
    frame = encode_batch(
        SampleBatch(3, 7, 11, 13, np.zeros((2, 1, 9), np.float32), np.array([0, 9], np.uint32))
    )
    head = struct.pack("<IHHHHQQQ", 0x314C4753, 1, 1, 2, 3, 7, 11, 13)
    body = head + bytes(2 * 9 * 4) + struct.pack("<II", 0, 9)
    assert frame == body + struct.pack("<I", crc32(body))
    assert frame[:4] == b"SGL1"


@given(
    samples=arrays(np.float32, st.tuples(st.integers(1, 4), st.integers(1, 3), st.just(9))),
    numbers=st.tuples(st.integers(0, 65_535), *[st.integers(0, (1 << 53) - 1)] * 3),
    with_offsets=st.booleans(),
)
def test_every_batch_comes_back_with_every_bit(
    samples: np.ndarray, numbers: tuple[int, int, int, int], with_offsets: bool
) -> None:
    offsets = np.arange(len(samples), dtype=np.uint32) * np.uint32(4_000_000) if with_offsets else None
    sent = SampleBatch(*numbers, samples, offsets)
    frame = encode_batch(sent)
    assert same(decode_batch(frame), sent)
    assert same(decode_batch(memoryview(frame), read_batch_header(frame)), sent)
    assert encode_batch(decode_batch(frame)) == frame
    assert bytes(view_samples(frame, read_batch_header(frame))) == samples.astype("<f4").tobytes()


def test_the_samples_of_a_decoded_batch_are_the_frames_own_memory() -> None:
    frame = encode_batch(small_batch())
    assert decode_batch(frame).samples.base is not None
    assert not decode_batch(frame).samples.flags.writeable


@pytest.mark.slow
@pytest.mark.parametrize("n", range(len(encode_batch(small_batch(n=2)))))
def test_a_frame_cut_anywhere_is_refused(n: int) -> None:
    assert refused(encode_batch(small_batch(n=2))[:n]) == "batch_shape"


def test_a_frame_with_any_bit_turned_is_refused() -> None:
    frame = encode_batch(small_batch(n=2, offsets=True))
    for bit in range(8 * len(frame)):
        turned = bytearray(frame)
        turned[bit // 8] ^= 1 << bit % 8
        assert refused(bytes(turned)) in ("batch_magic", "batch_shape", "batch_time", "batch_checksum")


@pytest.mark.parametrize(
    ("at", "kind", "value", "code"),
    [
        (0, "<I", 0x324C4753, "batch_magic"),
        (4, "<H", 2, "batch_shape"),
        (4, "<H", 1, "batch_shape"),
        (6, "<H", 0, "batch_shape"),
        (6, "<H", 65_535, "batch_shape"),
        (8, "<H", 0, "batch_shape"),
        (8, "<H", 1001, "batch_shape"),
        (12, "<Q", 1 << 53, "batch_time"),
        (20, "<Q", 1 << 63, "batch_time"),
        (28, "<Q", (1 << 64) - 1, "batch_time"),
    ],
)
def test_a_header_that_lies_is_refused_though_its_checksum_is_right(
    at: int, kind: str, value: int, code: str
) -> None:
    frame = bytearray(encode_batch(small_batch()))
    struct.pack_into(kind, frame, at, value)
    assert refused(sealed(frame)) == code


def test_a_length_that_lies_allocates_nothing() -> None:
    frame = bytearray(encode_batch(small_batch()))
    struct.pack_into("<HH", frame, 6, 65_535, 1000)
    tracemalloc.start()
    assert refused(sealed(frame)) == "batch_shape"
    lying = FILE_MARK + struct.pack("<II", 0xFFFFFFFF, 0) + b"B"
    assert scan(lying) == ([], len(FILE_MARK))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 200_000


def test_a_batch_too_large_is_refused_before_it_is_sent() -> None:
    with pytest.raises(InputError) as caught:
        encode_batch(SampleBatch(0, 0, 0, 0, np.zeros((1000, 64, 9), np.float32)))
    assert caught.value.code == "batch_shape"
    largest = SampleBatch(0, 0, 0, 0, np.zeros((1000, 29, 9), np.float32))
    assert len(encode_batch(largest)) <= MOST_FRAME_BYTES


@pytest.mark.parametrize(
    "wrong",
    [
        replace(small_batch(), samples=np.zeros((5, 2, 6), np.float32)),
        replace(small_batch(), samples=np.zeros((5, 18), np.float32)),
        replace(small_batch(), offsets_us=np.zeros(4, np.uint32)),
        replace(small_batch(), samples=np.zeros((0, 2, 9), np.float32)),
    ],
)
def test_samples_of_another_shape_are_no_batch(wrong: SampleBatch) -> None:
    with pytest.raises(InputError) as caught:
        encode_batch(wrong)
    assert caught.value.code == "batch_shape"


def test_a_batch_must_fit_the_hello() -> None:
    header = read_batch_header(encode_batch(small_batch()))
    assert check_fits(header, SMALL_HELLO) is SMALL_HELLO.streams[0]
    for other, code in (
        (header._replace(stream=4), "batch_stream"),
        (header._replace(n_imu=3), "batch_shape"),
    ):
        with pytest.raises(InputError) as caught:
            check_fits(other, SMALL_HELLO)
        assert caught.value.code == code


def test_json_batches_become_the_binary_ones() -> None:
    sent = small_batch(offsets=True)
    samples = [[[None if np.isnan(x) else float(x) for x in sensor] for sensor in s] for s in sent.samples]
    assert sent.offsets_us is not None
    text = {"type": "batch", "stream": 3, "seq": 0, "t0_us": sent.t0_us, "sent_us": sent.sent_us}
    whole = json.loads(json.dumps(text | {"samples": samples, "offsets_us": sent.offsets_us.tolist()}))
    assert same(batch_of_json(whole), sent)


@pytest.mark.parametrize(
    "change",
    [
        {"seq": -1}, {"seq": "0"}, {"seq": True}, {"seq": None}, {"t0_us": 1.5}, {"stream": 70_000},
        {"samples": None}, {"samples": []}, {"samples": [[[1, 2]]]}, {"samples": [[["x"] * 9]]},
        {"samples": [[[0] * 9], [[0] * 8]]}, {"samples": {}}, {"samples": [[[[0]] * 9]]},
        {"offsets_us": [1, 2, 3]}, {"offsets_us": [-1]}, {"offsets_us": ["a"]}, {"sent_us": 1 << 60},
    ],
)  # fmt: skip
def test_json_that_is_no_batch_is_refused(change: dict[str, object]) -> None:
    good: dict[str, object] = {"stream": 3, "seq": 0, "t0_us": 5, "sent_us": 6, "samples": [[[0.0] * 9]]}
    batch_of_json(good)
    with pytest.raises(InputError) as caught:
        batch_of_json(good | change)
    assert caught.value.code in ("batch_shape", "batch_time")


def test_a_log_is_scanned_into_its_records() -> None:
    take = small()
    records, length = scan(take.log())
    assert length == len(take.log())
    assert [r.kind for r in records] == ["H", "B", "B", "B", "F"]
    assert parse_hello(records[0].body) == SMALL_HELLO
    assert all(same(decode_batch(r.body), b) for r, b in zip(records[1:], take.batches, strict=False))
    assert parse_finish(records[-1].body) == take.finish()


def test_a_log_cut_at_every_byte_gives_the_longest_whole_prefix() -> None:
    log = small().log()
    ends = [len(FILE_MARK), *(r.end for r in scan(log)[0])]
    for n in range(len(log) + 1):
        records, length = scan(log[:n])
        whole = [e for e in ends if e <= n]
        assert length == (whole[-1] if whole else 0)
        assert len(records) == max(0, len(whole) - 1)


def test_a_bit_turned_anywhere_ends_the_log_before_its_record() -> None:
    log = small(2).log()
    ends = [r.end for r in scan(log)[0]]
    starts = [len(FILE_MARK), *ends[:-1]]
    for bit in range(8 * len(log)):
        turned = bytearray(log)
        turned[bit // 8] ^= 1 << bit % 8
        records, length = scan(bytes(turned))
        if bit // 8 < len(FILE_MARK):
            assert (records, length) == ([], 0)
            continue
        broken = max(k for k, s in enumerate(starts) if s <= bit // 8)
        assert (len(records), length) == (broken, starts[broken])


def test_a_log_is_read_on_from_where_it_ended() -> None:
    log = small(4).log()
    first, at = scan(log[: len(log) // 2])
    rest, end = scan(log, at)
    assert end == len(log)
    assert [*first, *rest] == scan(log)[0]
    tail, length = scan_records(log[at:])
    assert [r.body for r in tail] == [r.body for r in rest]
    assert length == len(log) - at


@pytest.mark.parametrize("tail", [b"\x00" * 40, b"\xff" * 40, record("B", b"")[:7], struct.pack("<II", 0, 0)])
def test_what_a_dying_disk_leaves_behind_the_log_is_not_read(tail: bytes) -> None:
    log = small().log()
    assert scan(log + tail)[1] == len(log)


@given(st.binary(max_size=300))
def test_no_bytes_make_the_scan_fail(junk: bytes) -> None:
    for data in (junk, FILE_MARK + junk, small(1).log() + junk):
        records, length = scan(data)
        assert length <= len(data)
        assert scan(data[:length])[0] == records
