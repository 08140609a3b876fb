"""Reference orientations: OpenSim .sto and plain tables."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.errors import FormatError
from sagittal.core.formats.orientation_table import read_orientation_table
from sagittal.core.frames import Floats
from sagittal.core.rotation import about

Q = about(2, np.linspace(0.0, 1.0, 20))
T: Floats = np.arange(20.0) * 0.01


def sto(kind: str = "Quaternion") -> bytes:
    rows = (
        f"{t:.3f}\t" + "\t".join([",".join(f"{x:.8f}" for x in q)] * 2) for t, q in zip(T, Q, strict=True)
    )
    head = f"DataRate=100\nDataType={kind}\nversion=3\nendheader\ntime\tpelvis_imu\ttibia_r_imu\n"
    return (head + "\n".join(rows) + "\n").encode()


def csv(columns: str, q: Floats = Q, t: Floats = T, separator: str = ",") -> bytes:
    rows = (separator.join(f"{x:.8f}" for x in (a, *b)) for a, b in zip(t, q, strict=True))
    return (columns.replace(",", separator) + "\n" + "\n".join(rows) + "\n").encode()


def test_an_opensim_file_gives_its_quaternions_by_column() -> None:
    table = read_orientation_table(sto(), "a.sto")
    assert list(table.q) == ["pelvis_imu", "tibia_r_imu"]
    np.testing.assert_allclose(table.q["tibia_r_imu"], Q, atol=1e-7)
    np.testing.assert_allclose(table.t_s, T)


@pytest.mark.parametrize(
    ("columns", "name"),
    [
        ("time,shank_l_qw,shank_l_qx,shank_l_qy,shank_l_qz", "shank_l"),
        ("t_s,shank_l_q_w,shank_l_q_x,shank_l_q_y,shank_l_q_z", "shank_l"),
        ("Time (s),00B40B91 q0,00B40B91 q1,00B40B91 q2,00B40B91 q3", "00B40B91"),
        ("timestamp,LeftFoot.w,LeftFoot.x,LeftFoot.y,LeftFoot.z", "LeftFoot"),
    ],
)
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_a_table_names_its_segments_in_its_columns(columns: str, name: str, separator: str) -> None:
    table = read_orientation_table(csv(columns, separator=separator), "a.csv")
    assert list(table.q) == [name]
    np.testing.assert_allclose(table.q[name], Q, atol=1e-7)


def test_the_order_of_columns_and_the_unit_of_time_are_what_their_names_say() -> None:
    data = csv(
        "pelvis_x,pelvis_y,pelvis_z,pelvis_w,time_ms", np.column_stack((Q[:, 2:], Q[:, :1], 1e3 * T)), Q[:, 1]
    )
    table = read_orientation_table(data, "a.csv")
    np.testing.assert_allclose(table.q["pelvis"], Q, atol=1e-7)
    np.testing.assert_allclose(table.t_s, T, atol=1e-9)


def test_a_row_that_is_no_rotation_is_unknown() -> None:
    q = Q.copy()
    q[3] = 0.0
    table = read_orientation_table(csv("time,a_w,a_x,a_y,a_z", q), "a.csv")
    assert np.isnan(table.q["a"][3]).all()
    assert np.isfinite(table.q["a"][[2, 4]]).all()


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (b"", "empty"),
        (b"\0\1\2\3", "no_quaternions"),
        (sto("double"), "no_quaternions"),
        (csv("time,acc_x,acc_y,acc_z,acc_t"), "no_quaternions"),
        (csv("frame,a_w,a_x,a_y,a_z"), "no_time"),
        (csv("time,a_w,a_x,a_y,a_z,a_x", np.c_[Q, Q[:, 1]]), "ambiguous_column"),
        (csv("time,a_w,a_x,a_y,a_z,a_qx", np.c_[Q, Q[:, 1]]), "ambiguous_column"),
        (csv("time,a_w,a_x,a_y,a_z,time", np.c_[Q, T]), "ambiguous_column"),
        (csv("time,a_w,a_x,a_y,a_z,timestamp (ms)", np.c_[Q, 1e3 * T]), "ambiguous_column"),
        (csv("time,a_w,a_x,a_y,a_z", t=T[::-1].copy()), "no_time"),
        (csv("time,a_w,a_x,a_y,a_z", 90.0 * Q), "not_unit"),
        (b"just a sentence\nand another\n", "bad_table"),
    ],
)
def test_what_is_no_reference_is_refused_with_a_reason(data: bytes, code: str) -> None:
    with pytest.raises(FormatError) as caught:
        read_orientation_table(data, "a.csv")
    assert caught.value.code == code
    assert "a.csv" in caught.value.message
