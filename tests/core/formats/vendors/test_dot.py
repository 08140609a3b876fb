"""Movella DOT: clocks, keys over the header, and what a file lacks."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.errors import FormatError
from sagittal.core.formats import SourceFile, read_recording
from sagittal.core.formats.source_spec import SourceSpec
from sagittal.core.formats.vendors import dot
from tests.core.formats import vendor_files as made
from tests.core.formats.vendor_reading import code_of, only, read


def test_dot_clocks_that_wrap_between_two_sensors_are_one_axis() -> None:
    late = made.dot(start_us=500).replace(b"L_shank", b"R_shank")
    files = [SourceFile.of_bytes("a", made.dot(start_us=2**32 - 20_000)), SourceFile.of_bytes("b", late)]
    left, right = read_recording(files).streams.values()
    assert right.t_s[0] - left.t_s[0] == pytest.approx(0.0205)
    rows = made.dot().split(b"\n")
    with_hole = b"\n".join(rows[:60] + rows[80:])
    assert np.diff(only(read(with_hole)).t_s).max() == pytest.approx(0.21)


def test_dot_files_say_what_they_lack() -> None:
    (notice,) = only(read(made.dot(head="Unsynced"))).notices
    assert notice.code == "not_synchronised"
    assert code_of(made.dot().replace(b"Acc_", b"FreeAcc_")) == "gravity_removed"
    assert code_of(made.dot().replace(b"Acc_", b"dv_")) == "missing_acc"
    assert "missing_gyro" in {n.code for n in only(read(made.dot().replace(b"Gyr_", b"dq_"))).notices}
    factory = made.dot().replace(b"L_shank", b"Xsens DOT")
    assert list(read(factory, "D4-22-CD-00_left foot.csv").streams) == ["D4-22-CD-00_left foot"]


def test_without_its_own_clock_the_packets_are_counted() -> None:
    (draft,) = dot.read(made.dot().replace(b"SampleTimeFine", b"Other"), "x.csv")
    assert draft.clock == "counter"
    stream = only(read(made.dot().replace(b"SampleTimeFine", b"Other")))
    assert stream.t_s == pytest.approx(made.T)


@pytest.mark.parametrize(
    ("said", "rate"), [("100Hz", 100.0), ("60 Hz", 60.0), ("12.5hz", 12.5), ("0.5Hz", None), ("fast", None)]
)
def test_the_rate_is_what_the_head_says(said: str, rate: float | None) -> None:
    (draft,) = dot.read(made.dot().replace(b"100Hz", said.encode()), "x.csv")
    assert draft.rate_hz == rate
    (told,) = dot.read(made.dot(), "x.csv", SourceSpec(file="x.csv", rate_hz=50.0))
    assert told.rate_hz == 50.0


def test_a_declared_unit_goes_before_the_usual_one() -> None:
    (draft,) = dot.read(made.dot(), "x.csv", SourceSpec(file="x.csv", acc_unit="g", gyr_unit="rad/s"))
    usual = dot.read(made.dot(), "x.csv")[0]
    assert draft.acc[0] == pytest.approx(usual.acc[0] * 9.80665)
    assert draft.gyr is not None
    assert usual.gyr is not None
    assert draft.gyr[0] == pytest.approx(np.degrees(usual.gyr[0]))


def test_a_head_without_its_line_of_names_is_refused() -> None:
    with pytest.raises(FormatError, match="no header line with PacketCounter") as refused:
        dot.read(made.dot().replace(b"PacketCounter,", b"Packets,"), "x.csv")
    assert refused.value.code == "bad_table"
    assert not dot.looks_like(made.dot().replace(b"DeviceTag:", b"Device:"))
