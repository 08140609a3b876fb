"""Damaged uploads: whatever happens to the bytes, the answer is a recording or a refusal, never a crash."""

from __future__ import annotations

import json
import random
from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.errors import SagittalError
from sagittal.core.formats import Manifest, SourceFile, manifest_of, read_recording, write_recording
from sagittal.core.quality import assess, describe
from sagittal.core.timeline import synchronise
from tests.core.formats.making import mt_file, mt_text, signals, zipped

ACC, GYR = signals(600, still=200)
CHANNELS = {"acc": ["a", "b", "c"], "gyr": ["d", "e", "f"]}
TABLE = {
    "file": "*",
    "rate_hz": 100,
    "acc_unit": "m/s2",
    "gyr_unit": "rad/s",
    "columns": {"foot_l": CHANNELS},
}
SCRAPS = (
    b"\n",
    b"\t",
    b",",
    b"NaN",
    b"1e400",
    b"-",
    b"\0",
    b'"',
    b"//",
    b"\r",
    b"9999999999",
    b"\xff",
    b"inf",
    b";",
)


def table() -> bytes:
    rows = [",".join(f"{v:.4f}" for v in row) for row in np.hstack([ACC, GYR])]
    return ("a,b,c,d,e,f\n" + "\n".join(rows)).encode()


UPLOADS: dict[str, tuple[bytes, Manifest | None]] = {
    "tab": (mt_text(ACC, GYR).encode(), None),
    "space": (mt_text(ACC, GYR, separator=" ").encode(), None),
    "table": (table(), manifest_of({"sources": [TABLE]})),
    "parquet": (write_recording(read_recording([mt_file()])), None),
    "zip": (
        zipped({"a_00B40B91.txt": mt_text(ACC, GYR).encode()[:20000], "manifest.json": b'{"sensors": {}}'}),
        None,
    ),
}


def damaged(data: bytes, rng: random.Random) -> bytes:
    """Change, insert, repeat, delete or cut; half of the time near the start, where headers are."""
    out = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 5, 30])):
        near = len(out) if rng.random() < 0.5 else min(600, len(out))
        at = rng.randrange(near + 1)
        kind = rng.randrange(5)
        if kind == 0 and at < len(out):
            out[at] = rng.randrange(256)
        elif kind == 1:
            out[at:at] = rng.choice(SCRAPS)
        elif kind == 2:
            out[at:at] = out[at : at + rng.choice([5, 50, 3000])]
        elif kind == 3:
            del out[at : at + rng.choice([1, 7, 100, 5000])]
        elif kind == 4:
            del out[at:]
    return bytes(out)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(UPLOADS))
def test_damaged_bytes_are_read_or_refused(name: str) -> None:
    data, manifest = UPLOADS[name]
    rng = random.Random(name)  # noqa: S311 - reproducible damage, no secret
    outcomes: set[str] = set()
    for _ in range(80):
        try:
            recording = read_recording([SourceFile.of_bytes("t_00B40B91.bin", damaged(data, rng))], manifest)
            json.dumps(describe(recording).to_json(), allow_nan=False)
            worn = replace(recording, segments={next(iter(recording.streams)): "foot_l"})
            uniform = synchronise(worn)
            json.dumps(assess(worn, uniform).to_json(), allow_nan=False)
            assert write_recording(worn)
            outcomes.add("read")
        except SagittalError as refusal:
            outcomes.add(refusal.code)
    assert len(outcomes) >= 3, outcomes


def test_a_flipped_bit_in_a_stored_recording_is_noticed() -> None:
    """Page checksums: signals that changed on disk are refused, not analysed."""
    data = UPLOADS["parquet"][0]
    for at in range(200, len(data) // 2, 997):
        broken = bytearray(data)
        broken[at] ^= 0x10
        try:
            again = read_recording([SourceFile.of_bytes("x", bytes(broken))])
        except SagittalError:
            continue
        assert again.streams["00B40B91"].digest == read_recording([mt_file()]).streams["00B40B91"].digest


def test_a_clock_that_jumps_cannot_ask_for_endless_memory() -> None:
    rows = table().decode().split("\n")
    timed = [
        "t," + rows[0],
        *(f"{i / 100 if i < 300 else 1e9 + i / 100}," + r for i, r in enumerate(rows[1:])),
    ]
    spec = TABLE | {"time_column": "t"}
    recording = read_recording(
        [SourceFile.of_bytes("t.csv", "\n".join(timed).encode())], manifest_of({"sources": [spec]})
    )
    with pytest.raises(SagittalError) as e:
        synchronise(recording)
    assert e.value.code == "clock_jump"
