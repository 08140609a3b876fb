"""The manifest: every mistake names its place and what would be right."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sagittal.core.errors import ManifestError
from sagittal.core.formats.aliases import segment_in, segment_named
from sagittal.core.formats.manifest import manifest_of, parse_manifest
from sagittal.core.formats.source_spec import Channels
from sagittal.core.subject.shoe import Shoe

SOURCE = {"file": "a.csv", "acc_unit": "g", "columns": {"foot_l": {"acc": ["x", "y", "z"]}}}


def test_a_full_manifest_is_understood() -> None:
    m = manifest_of(
        {
            "subject": {
                "height_m": 1.75,
                "standing_angles_deg": {"knee_flexion_l": 8, "pelvis_tilt": None},
                "shoe": {"back_m": 0.06, "front_m": 0.2},
            },
            "protocol": "walk",
            "mounting": {"pelvis": "sacrum, face backwards"},
            "sensors": {"00B40B91": "pelvis", "00B40C44": None, "x": "RightLowerLeg"},
            "sources": [
                SOURCE | {"header_rows": 2, "index_column": True, "rate_hz": 204.8, "gyr_unit": "deg/s"}
            ],
        }
    )
    assert m.subject.height_m == 1.75
    assert m.subject.standing_angles_deg == {"knee_flexion_l": 8.0}
    assert m.subject.shoe == Shoe(0.06, 0.2, 0.0)
    assert dict(m.sensors) == {"00B40B91": "pelvis", "00B40C44": None, "x": "shank_r"}
    spec = m.source_of("folder/a.csv")
    assert spec is not None
    assert spec.columns["foot_l"] == Channels(("x", "y", "z"))
    assert (spec.header_rows, spec.index_column, spec.rate_hz, spec.gravity_included) == (
        2,
        True,
        204.8,
        True,
    )
    assert m.source_of("b.csv") is None


def test_an_empty_manifest_says_nothing() -> None:
    m = manifest_of({})
    assert (m.subject.height_m, m.protocol, dict(m.sensors), m.sources) == (None, None, {}, ())


@pytest.mark.parametrize(
    ("value", "code", "place"),
    [
        ({"sensor": {}}, "manifest_unknown_key", "did you mean 'sensors'"),
        ({"subject": {"height": 1.7}}, "manifest_unknown_key", "subject.height"),
        ({"subject": {"height_m": 175}}, "height_implausible", "subject.height_m"),
        (
            {"subject": {"standing_width_m": 20}},
            "standing_width_implausible",
            "subject.standing_width_m",
        ),
        (
            {"subject": {"standing_angles_deg": {"knee_l": 5}}},
            "unknown_angle",
            "subject.standing_angles_deg: 'knee_l'",
        ),
        (
            {"subject": {"standing_angles_deg": {"knee_flexion_l": 170}}},
            "standing_angle_implausible",
            "knee_flexion_l",
        ),
        (
            {"subject": {"standing_angles_deg": {"knee_flexion_l": "5"}}},
            "manifest_bad_value",
            "subject.standing_angles_deg.knee_flexion_l",
        ),
        ({"subject": {"shoe": {"back_m": 0.06}}}, "manifest_bad_value", "subject.shoe needs both"),
        ({"subject": {"shoe": {"back_m": 6, "front_m": 0.19}}}, "shoe_implausible", "subject.shoe: back_m"),
        ({"subject": {"shoe": {"length_m": 0.3}}}, "manifest_unknown_key", "subject.shoe.length_m"),
        ({"subject": {"height_m": "175"}}, "manifest_bad_value", "subject.height_m"),
        ({"subject": {"height_m": True}}, "manifest_bad_value", "subject.height_m"),
        ({"subject": []}, "manifest_bad_value", "subject"),
        ({"protocol": "dance"}, "unknown_protocol", "walk, treadmill"),
        ({"sensors": {"a": "knee"}}, "unknown_segment", "sensors.a"),
        ({"sensors": {"a": "foot_l", "b": "LeftFoot"}}, "duplicate_segment", "sensors.b"),
        ({"sensors": {"a": 3}}, "manifest_bad_value", "sensors.a"),
        ({"mounting": {"knee": "x"}}, "unknown_segment", "mounting.knee"),
        ({"sources": {}}, "manifest_bad_value", "sources"),
        ({"sources": [{}]}, "manifest_bad_value", "sources[0].file"),
        ({"sources": [SOURCE | {"acc_unit": "ft"}]}, "unknown_unit", "sources[0].acc_unit"),
        ({"sources": [SOURCE | {"rate_hz": 0}]}, "manifest_bad_value", "sources[0].rate_hz"),
        ({"sources": [SOURCE | {"header_rows": -1}]}, "manifest_bad_value", "sources[0].header_rows"),
        ({"sources": [SOURCE | {"frame": "world"}]}, "unsupported_frame", "sources[0].frame"),
        ({"sources": [SOURCE | {"header": 2}]}, "manifest_unknown_key", "sources[0].header"),
        (
            {"sources": [{"file": "a", "columns": {"s": {"acc": ["x"]}}}]},
            "manifest_bad_value",
            "columns.s.acc",
        ),
        (
            {"sources": [{"file": "a", "columns": {"s": {"gyr": None}}}]},
            "manifest_bad_value",
            "columns.s.acc",
        ),
        ([], "manifest_bad_value", "The manifest"),
    ],
)
def test_a_mistake_names_its_place(value: object, code: str, place: str) -> None:
    with pytest.raises(ManifestError) as e:
        manifest_of(value)
    assert e.value.code == code
    assert place in e.value.message


@pytest.mark.parametrize(
    "data", [b"", b"{", b'{"a": NaN}', b'{"sensors": {}, "sensors": {}}', b"\xff\xfe", b"[" * 9999]
)
def test_what_is_not_json_is_refused(data: bytes) -> None:
    with pytest.raises(ManifestError) as e:
        parse_manifest(data)
    assert e.value.code == "manifest_bad_json"


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)
keys = st.sampled_from(["subject", "protocol", "mounting", "sensors", "sources"])


@pytest.mark.slow
@given(st.dictionaries(keys, json_values, max_size=4))
def test_any_json_is_a_manifest_or_a_manifest_error(value: dict[str, object]) -> None:
    try:
        manifest_of(json.loads(json.dumps(value)))
    except ManifestError as e:
        assert len(e.message) > 10  # noqa: PT017


@pytest.mark.parametrize(
    ("name", "segment"),
    [
        ("pelvis_imu", "pelvis"), ("femur_r_imu", "thigh_r"), ("tibia_l_imu", "shank_l"),
        ("calcn_r_imu", "foot_r"), ("torso_imu", "chest"), ("RightUpperLeg", "thigh_r"),
        ("LeftLowerLeg", "shank_l"), ("Right Foot", "foot_r"), ("Lumbar", "pelvis"),
        ("Right Lower Leg", "shank_r"), ("LTibia", "shank_l"), ("R_UpLeg", "thigh_r"), ("foot_l", "foot_l"),
        ("left", None), ("foot", None), ("00B40B91", None), ("hand_r_imu", None), ("", None),
    ],
)  # fmt: skip
def test_the_names_of_other_systems_are_known(name: str, segment: str | None) -> None:
    assert segment_named(name) == segment


@pytest.mark.parametrize(
    ("file", "segment"),
    [
        ("RTibia_20210820_202113_825.csv", "shank_r"),
        ("S02-Trial-Walk-1-L_Foot.csv", "foot_l"),
        ("a/b/Pelvis_1.txt.gz", "pelvis"),
        ("left foot and right foot.csv", None),
        ("MT_012005D6_009-001_00B421E6.txt", None),
    ],
)
def test_a_file_name_may_say_the_segment(file: str, segment: str | None) -> None:
    assert segment_in(file) == segment
