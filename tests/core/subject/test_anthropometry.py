"""Body lengths: measured ones are used, others estimated and marked."""

from __future__ import annotations

import pytest

from sagittal.core.body.chain.geometry import locate_hip
from sagittal.core.body.kinematics import nominal_body
from sagittal.core.body.model import BodyModel
from sagittal.core.errors import ManifestError
from sagittal.core.formats.manifest import manifest_of
from sagittal.core.subject.anthropometry import BodyMeasures, locate_hips_across


def test_nobody_measured_anything() -> None:
    body = BodyModel.from_height(1.8)
    assert (body.thigh, body.shank, body.ankle_height) == pytest.approx((0.441, 0.4428, 0.0702))
    assert body.estimated
    assert body.measured == ()


def test_a_measured_length_replaces_its_estimate_alone() -> None:
    body = BodyModel.from_height(1.8, BodyMeasures(thigh_m=0.5))
    assert body.thigh == 0.5
    assert body.shank == pytest.approx(0.246 * 1.8)
    assert (body.estimated, body.measured) == (True, ("thigh",))


def test_a_measured_leg_scales_what_of_it_was_not_measured() -> None:
    body = BodyModel.from_height(1.8, BodyMeasures(leg_m=0.53 * 1.6, shank_m=0.4))
    assert (body.thigh, body.shank) == pytest.approx((0.245 * 1.6, 0.4))
    assert body.foot == pytest.approx(0.152 * 1.8)


def test_a_leg_stands_for_the_height_that_nobody_gave() -> None:
    body, (notice,) = nominal_body(None, measures=BodyMeasures(leg_m=0.53 * 1.5))
    assert body.foot == pytest.approx(0.152 * 1.5)
    assert "1.50 m" in notice.message


def test_hips_lie_where_harrington_puts_them() -> None:
    assert locate_hips_across(0.24) == pytest.approx(2 * 0.0865)
    assert locate_hips_across(0.24, 0.15) == pytest.approx(2 * 0.0883)
    assert locate_hips_across(0.24, 0.15) == pytest.approx(2 * locate_hip(0.24, 0.15, 0.9)[2])
    assert BodyModel.from_height(1.7, BodyMeasures(pelvis_width_m=0.24)).measured == ("hip_width",)


def test_the_manifest_has_them_and_keeps_them() -> None:
    subject = manifest_of({"subject": {"height_m": 1.7, "measures": {"leg_m": 0.9}}}).subject
    assert subject.measures == BodyMeasures(leg_m=0.9)
    assert subject.to_json()["measures"] == {"leg_m": 0.9}
    other_subject = manifest_of({"subject": {"measures": {"leg_m": 0.8, "foot_m": 0.25}}}).subject
    assert subject.complete_from(other_subject).measures == BodyMeasures(leg_m=0.9, foot_m=0.25)


@pytest.mark.parametrize("measures", [{"leg_m": 90}, {"leg": 0.9}])
def test_a_length_in_centimetres_or_of_another_name_is_refused(measures: dict[str, float]) -> None:
    with pytest.raises(ManifestError):
        manifest_of({"subject": {"measures": measures}})
