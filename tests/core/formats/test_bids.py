"""BIDS motion: a table described by the files beside it."""

from __future__ import annotations

import re

import pytest

from sagittal.core.errors import FormatError
from sagittal.core.formats import bids
from tests.core.formats import vendor_files as made
from tests.core.formats.vendor_reading import read_parts
from tests.data import data_folder


def test_bids_tables_are_read_by_the_files_beside_them() -> None:
    recording = read_parts(made.bids_parts())
    assert dict(recording.segments) == {"LeftFoot": "foot_l", "Lumbar": "pelvis"}
    stream = recording.streams["Lumbar"]
    assert stream.rate_hz == made.RATE
    assert stream.acc == pytest.approx(made.ACC, abs=1e-6)
    assert stream.gyr == pytest.approx(made.GYR, abs=1e-6)
    assert len(recording.sha256) == 3
    assert not recording.notices
    for parts, code in (
        (made.bids_parts(types=("POS", "ORNT")), "missing_acc"),
        (made.bids_parts(acc_unit="furlong"), "unknown_unit"),
        (
            {
                n: d.replace(b"\t", b"\t0\t") if "_motion.tsv" in n else d
                for n, d in made.bids_parts().items()
            },
            "bad_table",
        ),
        (
            {n: d.replace(b"Lumbar\t", b"LeftFoot\t") for n, d in made.bids_parts().items()},
            "ambiguous_column",
        ),
        (
            {n: re.sub(rb"\t[yz]\tGYRO", b"\tn/a\tLATENCY", d) for n, d in made.bids_parts().items()},
            "ambiguous_column",
        ),
    ):
        with pytest.raises(FormatError) as refused:
            read_parts(parts)
        assert refused.value.code == code


@pytest.mark.recorded
def test_a_real_bids_recording_of_positions_says_so() -> None:
    folder = data_folder("formats", "bids_motion")
    parts = {p.name: p.read_bytes() for p in folder.iterdir()}
    stem = next(name for name in parts if name.endswith("_channels.tsv")).removesuffix("_channels.tsv")
    with pytest.raises(FormatError, match="POS") as refused:
        read_parts({**parts, f"{stem}_motion.tsv": b"0\t0\t0\t0\t0\t0\t1\t0\n" * 50})
    assert refused.value.code == "missing_acc"


NAME = "sub-01_tracksys-imu_motion.tsv"
HEADER = "name\tcomponent\ttype\ttracked_point\tunits\tplacement\tsampling_frequency"


def channels(*more: str, unit: str = "m/s^2", point: str = "IMU1", frequency: str = "50") -> bytes:
    """Acceleration of one point, and what else is named."""
    lines = [f"a_{a}\t{a}\tACCEL\t{point}\t{unit}\tleft foot\t{frequency}" for a in "xyz"]
    return "\n".join([HEADER, *lines, *more]).encode()


def describe(table: bytes, columns: int = 3, sidecar: bytes | None = None) -> bids.BidsTable:
    return bids.describe_table(NAME, b"\t".join([b"0"] * columns) + b"\n", table, sidecar)


def test_columns_are_numbered_and_a_point_is_worn_where_its_placement_says() -> None:
    found = describe(channels(unit="g"))
    assert found.spec.columns is not None
    assert found.spec.columns["IMU1"].acc == ("1", "2", "3")
    assert (found.spec.acc_unit, found.spec.gyr_unit, found.spec.rate_hz) == ("g", None, 50.0)
    assert dict(found.worn) == {"IMU1": "foot_l"}
    assert dict(describe(channels(unit="g", point="pelvis")).worn) == {"pelvis": "pelvis"}


def test_a_column_of_latency_is_the_time() -> None:
    found = describe(channels("t\tn/a\tLATENCY\tn/a\tseconds\tn/a\t50", unit="g"), 4).spec
    assert (found.time_column, found.time_unit) == ("4", "s")
    assert describe(channels(unit="g")).spec.time_column is None


@pytest.mark.parametrize(
    ("sidecar", "rate"),
    [
        (b'{"SamplingFrequencyEffective": 99.5, "SamplingFrequency": 100}', 99.5),
        (b'{"SamplingFrequencyEffective": "n/a", "SamplingFrequency": 100}', 100.0),
        (b'{"SamplingFrequency": 0.5}', 50.0),
        (b"[]", 50.0),
        (b"{", 50.0),
        (None, 50.0),
    ],
)
def test_the_rate_is_what_it_came_to_else_what_was_set_else_what_the_channels_say(
    sidecar: bytes | None, rate: float
) -> None:
    assert describe(channels(unit="g"), 3, sidecar).spec.rate_hz == rate


@pytest.mark.parametrize(
    ("table", "columns", "code"),
    [
        (channels(unit="g"), 4, "bad_table"),
        (channels("x\ty", unit="g"), 4, "bad_table"),
        (channels(unit="g", frequency="n/a"), 3, "rate_missing"),
        (channels("v\tx\tACCEL\tother\tfurlong\tn/a\t50", unit="g"), 4, "unknown_unit"),
        (channels("v\tX\taccel\tIMU1\tg\tn/a\t50", unit="g"), 4, "ambiguous_column"),
    ],
)
def test_what_does_not_fit_together_is_refused(table: bytes, columns: int, code: str) -> None:
    with pytest.raises(FormatError, match=NAME) as refused:
        describe(table, columns)
    assert refused.value.code == code


def test_files_are_told_by_header_and_name() -> None:
    assert bids.looks_like(channels())
    assert not bids.looks_like(b"name\ttype\n")
    assert not bids.looks_like(b" \n")
    assert bids.is_table("a/b_Motion.TSV")
    assert not bids.is_table("b_motion.csv")
    assert bids.find_parts("a/b_motion.tsv") == ("a/b_channels.tsv", "a/b_motion.json")
