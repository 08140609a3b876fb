"""OpenSense mappings: which sensor is worn where."""

from __future__ import annotations

import pytest

from sagittal.core.errors import FormatError
from sagittal.core.formats.vendors.mapping_xml import looks_like, read


def mapping(*sensors: tuple[str, str], head: str = "") -> bytes:
    rows = "".join(
        f'<ExperimentalSensor name="{name}"><name_in_model> {body} </name_in_model></ExperimentalSensor>'
        for name, body in sensors
    )
    return f'<?xml version="1.0"?>{head}<OpenSimDocument>{rows}</OpenSimDocument>'.encode()


def test_sensors_are_worn_where_their_bodies_are() -> None:
    data = mapping(
        ("_00b42268", "pelvis_imu"), ("00B4226B", "tibia_r_imu"), ("_X1", "hand_l_imu"), ("_", "pelvis_imu")
    )
    assert looks_like(data)
    assert looks_like(b"  \n" + data)
    assert read(data, "map.xml") == {"00B42268": "pelvis", "00B4226B": "shank_r", "X1": None}


def test_other_files_are_no_mapping() -> None:
    assert not looks_like(b"<OpenSimDocument/>")
    assert not looks_like(b"x<ExperimentalSensor ")
    assert not looks_like(b"")


@pytest.mark.parametrize(
    "data",
    [
        mapping(("_1", "pelvis_imu"))[:-5],
        mapping(("_1", "pelvis_imu"), head='<!DOCTYPE x [<!ENTITY a "b">]>'),
        mapping(("_1", "pelvis_imu")).replace(b'"1.0"', b'"1.0" encoding="no-such-code"'),
    ],
)
def test_what_is_no_plain_xml_is_refused(data: bytes) -> None:
    with pytest.raises(FormatError, match=r"map\.xml is not readable XML") as refused:
        read(data, "map.xml")
    assert refused.value.code == "bad_xml"
