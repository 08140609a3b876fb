"""Cost of reading relative to the minimum for the same bytes, by format."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from pyarrow import csv

from sagittal.core.formats import SourceFile, read_recording, write_recording
from sagittal.core.formats.text import to_utf8
from sagittal.core.formats.vendors import cwa, device_motion
from sagittal.core.formats.vendors.registry import find_vendor
from tests.core.formats.making import mt_text
from tests.core.formats.vendor_files import VENDOR_SAMPLES, N
from tests.helpers.pairs import in_pairs
from validation.bench.long_cwa import write_long_cwa
from validation.figures import record_goal

MINUTES = 10
RATE = 100
SENSORS = 7
LAST_NAME = b"Gyr_Z\n"


@pytest.fixture(scope="module")
def files() -> list[SourceFile]:
    rng = np.random.default_rng(0)
    n = MINUTES * 60 * RATE
    shared = mt_text(rng.normal(0, 10, (n, 3)), rng.normal(0, 3, (n, 3))).encode()
    return [SourceFile.of_bytes(f"take_00B40C{i:02d}.txt", shared) for i in range(SENSORS)]


def parse_tables(files: list[SourceFile]) -> None:
    """What any reader has to do at least: every table's text into columns of numbers, on one thread."""
    for file in files:
        text = file.read()
        table = csv.read_csv(
            io.BytesIO(text[text.index(LAST_NAME) + len(LAST_NAME) :]),
            read_options=csv.ReadOptions(use_threads=False, autogenerate_column_names=True),
            parse_options=csv.ParseOptions(delimiter="\t"),
        )
        assert len(table) == MINUTES * 60 * RATE
        assert [c.to_numpy().dtype.kind for c in table.columns][2:] == ["f"] * 6


def test_ten_minutes_of_seven_sensors_cost_at_most_twice_what_parsing_them_does(
    files: list[SourceFile],
) -> None:
    size = sum(f.size for f in files) / 1e6
    ours, theirs, ratio = in_pairs(lambda: read_recording(files), lambda: parse_tables(files))
    sys.stdout.write(
        f"\nMT text: {size:.1f} MB at {size / ours:.0f} MB/s of CPU, pyarrow's tables alone at "
        f"{size / theirs:.0f} MB/s: {ratio:.2f} times its CPU\n"
    )
    record_goal("import of MT text, of a core", 200.0, size / ours, "MB/s", at_least=True)
    assert ratio <= 2.0


@pytest.mark.parametrize(
    "label", ["Movella DOT CSV", "APDM CSV", "APDM CSV, Mobility Lab", "Shimmer Consensys CSV"]
)
def test_other_text_formats_cost_at_most_three_times_what_parsing_them_does(label: str) -> None:
    name, make = VENDOR_SAMPLES[label]
    walk = make()
    start = len(walk) - len(b"".join(walk.splitlines(keepends=True)[-N:]))
    head, rows = walk[:start], walk[start:] * 60
    vendor = find_vendor(walk)
    assert vendor is not None
    separator = "\t" if b"\t" in rows[:200] else ","
    options = csv.ReadOptions(use_threads=False, autogenerate_column_names=True)

    def parse() -> None:
        csv.read_csv(io.BytesIO(rows), options, csv.ParseOptions(delimiter=separator))

    data = head + rows
    ours, _, ratio = in_pairs(lambda: vendor.read(to_utf8(data), name, None), parse)
    speed = len(data) / 1e6 / ours
    sys.stdout.write(f"\n{label}: {speed:.0f} MB/s of CPU, {ratio:.2f} times pyarrow's\n")
    record_goal(f"import of {label}, of a core", 200.0, speed, "MB/s", at_least=True)
    assert ratio <= 3.0


def test_a_stored_take_is_smaller_and_faster_than_its_text(files: list[SourceFile]) -> None:
    recording = read_recording(files)
    data = write_recording(recording)
    stored = [SourceFile.of_bytes("take.parquet", data)]
    from_store, from_text, ratio = in_pairs(lambda: read_recording(stored), lambda: read_recording(files))
    packed, plain = len(data) / 1e6, sum(f.size for f in files) / 1e6
    sys.stdout.write(
        f"\nParquet: {packed:.1f} MB in {from_store:.3f} s, text {plain:.1f} MB in {from_text:.3f} s of CPU\n"
    )
    record_goal("import of Parquet, of a core", 400.0, packed / from_store, "MB/s", at_least=True)
    assert packed < 0.5 * plain
    assert ratio < 0.5


def test_a_stored_take_costs_at_most_three_times_what_its_columns_do(files: list[SourceFile]) -> None:
    data = write_recording(read_recording(files))
    stored = [SourceFile.of_bytes("take.parquet", data)]
    values = 0

    def read_columns() -> None:
        """Columns alone, without checksums, hashing, layout or checks."""
        nonlocal values
        table = pq.ParquetFile(pa.BufferReader(data)).read(use_threads=False)
        values = sum(column.to_numpy().nbytes for column in table.columns)

    ours, theirs, ratio = in_pairs(lambda: read_recording(stored), read_columns)
    sys.stdout.write(
        f"\nParquet: {len(data) / 1e6:.1f} MB at {len(data) / 1e6 / ours:.0f} MB/s of CPU, its values at "
        f"{values / 1e6 / ours:.0f}; pyarrow's columns alone at {len(data) / 1e6 / theirs:.0f} and "
        f"{values / 1e6 / theirs:.0f}: {ratio:.2f} times its CPU\n"
    )
    assert ratio <= 3.0


def test_binary_blocks_cost_at_most_three_times_what_unpacking_them_does(tmp_path: Path) -> None:
    data = write_long_cwa(tmp_path / "long.cwa", 0.5).read_bytes()

    def unpack() -> None:
        """What any reader has to do at least: the packed numbers as floats, and a time for each."""
        blocks = np.frombuffer(data[cwa.HEADER :], np.uint8).reshape(-1, cwa.BLOCK)
        words = np.ascontiguousarray(blocks[:, 30:510]).view("<i4")
        out = np.empty((*words.shape, 3))
        for i in range(3):
            np.multiply(((words << (22 - 10 * i)) >> 22) << (words >> 30 & 3), 0.038, out=out[..., i])
        assert len(np.arange(words.size) * 0.02) == len(out.reshape(-1, 3))

    ours, theirs, ratio = in_pairs(lambda: cwa.read(data, "long.cwa"), unpack)
    size = len(data) / 1e6
    sys.stdout.write(
        f"\nAxivity CWA: {size:.1f} MB at {size / ours:.0f} MB/s of CPU, unpacking alone at "
        f"{size / theirs:.0f} MB/s: {ratio:.2f} times its CPU\n"
    )
    assert ratio <= 3.0


def test_a_phone_costs_at_most_four_times_what_parsing_its_json_does() -> None:
    name, make = VENDOR_SAMPLES["DeviceMotion JSON"]
    data = json.dumps({"events": json.loads(make())["events"] * 60}).encode()
    ours, theirs, ratio = in_pairs(lambda: device_motion.read(data, name), lambda: json.loads(data))
    size = len(data) / 1e6
    sys.stdout.write(
        f"\nDeviceMotion JSON: {size:.1f} MB at {size / ours:.0f} MB/s of CPU, Python's JSON alone at "
        f"{size / theirs:.0f} MB/s: {ratio:.2f} times its CPU\n"
    )
    assert ratio <= 4.0  # 2.7
