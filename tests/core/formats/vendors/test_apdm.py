"""APDM as CSV: monitors by their labels, units of time and signals, and refusals."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.errors import FormatError
from sagittal.core.formats.vendors import apdm
from tests.core.formats import vendor_files as made
from tests.core.formats.vendor_reading import code_of, only, read


def test_two_monitors_of_one_label_are_refused() -> None:
    assert code_of(made.apdm_studio().replace(b"Left Ankle", b"Lumbar")) == "ambiguous_column"


def test_a_row_of_units_says_what_the_time_is_in_or_the_file_is_refused() -> None:
    lab = made.apdm_lab()
    assert np.diff(only(read(lab)).t_s) == pytest.approx(1.0 / made.RATE)
    fast = only(read(lab.replace(b"\ns,m/s^2", b"\nms,m/s^2"))).t_s
    assert np.diff(fast) == pytest.approx(1e-3 / made.RATE)
    assert code_of(lab.replace(b"\ns,m/s^2", b"\nframes,m/s^2")) == "unknown_unit"
    assert code_of(lab.replace(b"\ns,m/s^2", b"\nms,g")) == "unknown_unit"
    assert code_of(made.apdm_lab(unit="deg/s")) == "unknown_unit"


def test_monitors_have_their_number_or_their_label_and_are_worn_where_that_says() -> None:
    studio = apdm.read(made.apdm_studio(), "studio.csv")
    assert [(d.device_id, d.segment) for d in studio] == [("5718", "pelvis"), ("5811", "shank_l")]
    lab = apdm.read(made.apdm_lab(), "lab.csv")
    assert [(d.device_id, d.segment) for d in lab] == [("Left Foot", "foot_l"), ("Right Foot", "foot_r")]
    assert [d.rate_hz for d in (*studio, *lab)] == [None, None, 100.0, 100.0]
    assert studio[0].quat is not None
    assert studio[0].quat[5] == pytest.approx(made.Q[5], abs=1e-8)


def test_a_monitor_without_acceleration_is_left_out_and_a_file_without_any_is_refused() -> None:
    lab = made.apdm_lab()
    (right,) = apdm.read(lab.replace(b"Left Foot/Acceleration", b"Left Foot/Force"), "lab.csv")
    assert right.device_id == "Right Foot"
    with pytest.raises(FormatError) as refused:
        apdm.read(lab.replace(b"/Acceleration", b"/Force"), "lab.csv")
    assert refused.value.code == "missing_acc"


@pytest.mark.parametrize(
    "data", [b"Format=7,5718\nTime,Accelerometer\n", b"Name:,Walk\nTime,a/Acceleration/X,"]
)
def test_a_head_without_samples_is_empty(data: bytes) -> None:
    assert apdm.looks_like(data)
    with pytest.raises(FormatError) as refused:
        apdm.read(data, "x.csv")
    assert refused.value.code == "empty"
