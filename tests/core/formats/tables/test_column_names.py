"""Names of columns and files."""

from __future__ import annotations

import pytest

from sagittal.core.formats.tables.column_names import is_time_name, read_file_kind, read_name


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("foot_l_acc_x", ("foot_l", "acc", "x", "")),
        ("ax_m/s/s", ("", "acc", "x", "m/s2")),
        ("gz", ("", "gyr", "z", "")),
        ("gFx", ("", "acc", "x", "g")),
        ("x-axis (deg/s)", ("", "gyr", "x", "deg/s")),
        ("L FOOT: ACC.X 1 [g]", ("L FOOT", "acc", "x", "g")),
        ("FreeAcc_X", None),
        ("x", None),
    ],
)
def test_a_name_says_sensor_quantity_axis_and_unit(name: str, expected: object) -> None:
    assert read_name(name) == expected


def test_axes_alone_are_what_their_file_is() -> None:
    assert read_name("z", "gyr") == ("", "gyr", "z", "")
    assert read_file_kind("left_foot_Gyroscope.csv") == ("gyr", "left_foot")
    assert read_file_kind("phone/Accelerometer.csv") == ("acc", "phone")
    assert read_file_kind("MetaWear_C2B2CE9BB701_Accelerometer_100Hz.csv") == ("acc", "C2B2CE9BB701")


def test_times_are_told_from_signals() -> None:
    assert all(map(is_time_name, ("timestamp_us", "tod_s", "epoc (ms)", "Time (s)", "t")))
    assert not any(map(is_time_name, ("foot_l_acc_x", "pc", "X [s]", "status")))
