"""Xsens MVNX: signals made of orientations, lost frames, and what is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest

from sagittal.core.errors import FormatError
from sagittal.core.formats.source_spec import SourceSpec
from sagittal.core.formats.vendors import mvnx
from tests.core.formats import vendor_files as made
from tests.core.formats.vendor_reading import code_of, only, read


def test_mvnx_with_entities_is_refused_and_lost_frames_are_holes() -> None:
    bomb = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>\n'
    assert code_of(made.mvnx(head=bomb)) == "bad_xml"
    assert code_of(made.mvnx().replace(b"UTF-8", b"no-such-code")) == "bad_xml"
    assert code_of(made.mvnx()[:-9]) == "bad_xml"
    assert code_of(made.mvnx().replace(b"sensorFreeAcceleration", b"acceleration")) == "missing_acc"
    stream = only(read(made.mvnx(skip=(50, 51))))
    assert len(stream.t_s) == made.N - 2
    assert np.diff(stream.t_s).max() == pytest.approx(0.03)
    assert stream.gyr == pytest.approx(made.GYR[2:], abs=1e-3)
    empty = re.sub(rb"(<sensorMagneticField>).*?(</sensorMagneticField>)", rb"\1\2", made.mvnx())
    assert len(only(read(empty)).t_s) == made.N
    moved = re.sub(
        rb"( \S+)(</sensorFreeAcceleration><sensorMagneticField>)", rb"\2\1 ", made.mvnx(), count=3
    )
    assert len(only(read(moved)).t_s) == made.N - 3


def test_labels_become_segments_and_what_was_made_is_said_once() -> None:
    leg, head = mvnx.read(made.mvnx(skip=(3,)), "walk.mvnx")
    assert [(d.device_id, d.segment) for d in (leg, head)] == [("RightLowerLeg", "shank_r"), ("Head", None)]
    assert [n.code for n in leg.notices] == ["signals_derived"]
    assert not head.notices
    assert leg.clock == "counter"
    assert leg.rate_hz == 100.0


def test_frames_without_signals_are_counted() -> None:
    hurt = re.sub(rb"<sensorOrientation>[^<]*<", b"<sensorOrientation>1 0 0<", made.mvnx(), count=5)
    leg, _ = mvnx.read(hurt, "walk.mvnx")
    (notice,) = [n for n in leg.notices if n.code == "truncated_line"]
    assert ": 5 frames lack" in notice.message
    assert len(leg.acc) == made.N - 5


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        (b'frameRate="100"', b'frameRate="0.5"', "rate_missing"),
        (b'frameRate="100"', b"", "rate_missing"),
        (b'type="normal"', b'type="tpose"', "empty"),
        (b"<sensor label", b"<thing label", "missing_acc"),
    ],
)
def test_what_is_missing_is_named(old: bytes, new: bytes, code: str) -> None:
    with pytest.raises(FormatError) as refused:
        mvnx.read(made.mvnx().replace(old, new), "walk.mvnx")
    assert refused.value.code == code


def test_a_rate_of_the_manifest_goes_before_the_files() -> None:
    (leg, _) = mvnx.read(made.mvnx(), "walk.mvnx", SourceSpec(file="walk.mvnx", rate_hz=50.0))
    assert leg.rate_hz == 50.0
    assert leg.gyr is not None
    assert leg.gyr[5] == pytest.approx(made.GYR[5] / 2.0, abs=1e-3)


def test_an_orientation_that_is_none_leaves_a_hole() -> None:
    zero = re.sub(rb"(<sensorOrientation>)[^<]*", rb"\g<1>0 0 0 0 1 0 0 0", made.mvnx(), count=1)
    leg, head = mvnx.read(zero, "walk.mvnx")
    assert np.isnan(leg.acc[0]).all()
    assert np.isfinite(leg.acc[1:]).all()
    assert np.isfinite(head.acc).all()
