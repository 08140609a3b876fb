"""Shimmer Consensys: two accelerometers, units, and what is not calibrated."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.errors import FormatError
from sagittal.core.formats.source_spec import SourceSpec
from sagittal.core.formats.vendors import shimmer
from sagittal.core.frames import GRAVITY
from tests.core.formats import vendor_files as made
from tests.core.formats.vendor_reading import code_of, only, read


def test_shimmer_reads_the_accelerometer_that_does_not_clip() -> None:
    clipped = np.clip(made.ACC * 3, -2 * GRAVITY, 2 * GRAVITY)
    stream = only(read(made.shimmer(acc=clipped)))
    assert stream.acc == pytest.approx(made.ACC, abs=1e-6)
    assert [n.code for n in stream.notices] == ["wide_range_read"]
    assert code_of(made.shimmer(unit="no_units")) == "unknown_unit"
    assert code_of(made.shimmer(kind="RAW")) == "missing_acc"


def test_time_in_other_units_is_read_or_refused() -> None:
    (ms,) = shimmer.read(made.shimmer(), "x.csv")
    (s,) = shimmer.read(made.shimmer().replace(b"\nms\t", b"\ns\t"), "x.csv")
    assert np.diff(s.ticks) == pytest.approx(1000.0 * np.diff(ms.ticks), rel=1e-3)
    assert code_of(made.shimmer().replace(b"\nms\t", b"\nticks\t")) == "unknown_unit"


@pytest.mark.parametrize(("unit", "times"), [("m/s^2", 1.0), ("g", GRAVITY)])
def test_the_row_of_units_is_heard(unit: str, times: float) -> None:
    (draft,) = shimmer.read(made.shimmer(acc=made.ACC / 10.0, unit=unit), "x.csv")
    assert draft.acc == pytest.approx(made.ACC / 10.0 * times, abs=1e-6)
    spec = SourceSpec(file="x.csv", acc_unit="g")
    (told,) = shimmer.read(made.shimmer(acc=made.ACC / 10.0, unit="no_units"), "x.csv", spec)
    assert told.acc == pytest.approx(made.ACC / 10.0 * GRAVITY, abs=1e-6)


def test_without_a_low_noise_accelerometer_the_other_one_is_read() -> None:
    (draft,) = shimmer.read(made.shimmer().replace(b"Accel_LN_X", b"Accel_XX_X"), "x.csv")
    assert draft.acc == pytest.approx(made.ACC, abs=1e-6)
    assert [n.code for n in draft.notices] == []


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [(b"Timestamp_Unix_CAL", b"Timestamp_Unix_RAW", "no_time"), (b"Accel_", b"Force_", "missing_acc")],
)
def test_what_is_missing_is_named_with_its_sensor(old: bytes, new: bytes, code: str) -> None:
    with pytest.raises(FormatError) as refused:
        shimmer.read(made.shimmer().replace(old, new), "x.csv")
    assert (refused.value.code, refused.value.sensor) == (code, "Shimmer_952D")


def test_a_comma_is_the_separator_where_nothing_else_is_said() -> None:
    lines = made.shimmer().split(b"\n", 1)[1].replace(b"\t", b",")
    assert shimmer.looks_like(lines)
    (draft,) = shimmer.read(lines, "x.csv")
    assert len(draft.acc) == made.N
    assert not shimmer.looks_like(b"time,acc_x,acc_y,acc_z\n")
