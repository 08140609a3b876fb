"""One sequence, one sign table: each clinical sign on each side, zero, subsets, gimbal."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sagittal.core.angles import SIGNS, cardan_zxy, compute_headings, pelvis_angles
from sagittal.core.angles.measure import measure_angles
from sagittal.core.frames import R_NEUTRAL, SIDES, SUFFIX, Bools, Floats, Segment
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import about, from_matrix, multiply, rotate
from tests.helpers.walks import simulated

NEUTRAL = from_matrix(R_NEUTRAL)
LEG = ("pelvis", "thigh", "shank", "foot")


def pose(**q: Floats) -> Orientations:
    """Two seconds: standing neutral, then each given segment turned by its own quaternion in segment axes."""
    n = 200
    segments: tuple[Segment, ...] = (
        "pelvis", "thigh_l", "thigh_r", "shank_l", "shank_r", "foot_l", "foot_r",
    )  # fmt: skip
    out: dict[Segment, Floats] = {}
    for s in segments:
        out[s] = np.tile(NEUTRAL, (n, 1))
        if s in q:
            out[s][100:] = multiply(NEUTRAL, q[s])
    valid = {s: np.ones(n, bool) for s in out}
    return Orientations(np.arange(n) / 100.0, 100.0, out, valid, "test")


def found(orientations: Orientations) -> dict[str, float]:
    """Degrees of every angle after the change."""
    angles = measure_angles(orientations, (0.0, 1.0)).angles
    return {k: float(np.degrees(x[150])) for k, x in angles.items()}


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_cardan_angles_are_those_the_rotation_was_made_of(a: float, b: float, c: float) -> None:
    q = multiply(multiply(about(2, a), about(0, b)), about(1, c))
    np.testing.assert_allclose(cardan_zxy(q), [a, b, c], atol=1e-7)


@pytest.mark.parametrize("side", SIDES)
def test_clinical_signs(side: str) -> None:
    """Thigh forward = hip flexion; shank back = knee flexion; toes up = dorsiflexion, on both sides."""
    end = SUFFIX[side]  # type: ignore[index]
    thigh, shank, foot = (f"{x}_{end}" for x in LEG[1:])
    forward = about(2, np.radians(20.0))
    hip = found(pose(**{thigh: forward, shank: forward, foot: forward}))
    assert hip[f"hip_flexion_{end}"] == pytest.approx(20.0)
    back = about(2, np.radians(-30.0))
    knee = found(pose(**{shank: back, foot: back}))
    assert knee[f"knee_flexion_{end}"] == pytest.approx(30.0)
    assert knee[f"hip_flexion_{end}"] == pytest.approx(0.0, abs=1e-9)
    ankle = found(pose(**{foot: about(2, np.radians(10.0))}))
    assert ankle[f"ankle_dorsiflexion_{end}"] == pytest.approx(10.0)


@pytest.mark.parametrize("side", SIDES)
def test_frontal_and_transverse_signs_are_mirrored(side: str) -> None:
    """Knee towards the midline = adduction; toes towards the midline = internal rotation, on both sides."""
    end = SUFFIX[side]  # type: ignore[index]
    mirror = 1.0 if side == "right" else -1.0
    # a right leg that swings to the left moves its distal end along −z: that is +x rotation in segment axes
    inward = about(0, np.radians(8.0 * mirror))
    leg = pose(**{f"{x}_{end}": inward for x in LEG[1:]})
    assert found(leg)[f"hip_adduction_{end}"] == pytest.approx(8.0)
    distal = _down(leg.q[f"thigh_{end}"][150])  # type: ignore[index]
    assert np.sign(distal[1]) == mirror, "towards the body's midline: left for the right leg"
    turned_in = about(1, np.radians(12.0 * mirror))
    assert found(pose(**{f"foot_{end}": turned_in}))[f"ankle_rotation_{end}"] == pytest.approx(12.0)


def _down(q: Floats) -> Floats:
    return rotate(q, np.array([0.0, -1.0, 0.0]))


def test_pelvis_signs() -> None:
    """Anterior tilt positive: the top of the pelvis leans forward. Obliquity positive: right side up."""
    tilt, obliquity = pelvis_angles(multiply(NEUTRAL, about(2, np.radians(-7.0))))
    assert np.degrees(tilt) == pytest.approx(7.0)
    assert obliquity == pytest.approx(0.0)
    raised = multiply(NEUTRAL, about(0, np.radians(-5.0)))
    assert np.degrees(pelvis_angles(raised)[1]) == pytest.approx(5.0)
    assert rotate(raised, np.array([0.0, 0.0, 1.0]))[2] > 0


@given(st.floats(-3.1, 3.1), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_pelvis_tilt_and_obliquity_do_not_depend_on_the_direction_of_walking(
    heading: float, obliquity: float, tilt: float
) -> None:
    own = multiply(multiply(NEUTRAL, about(0, -obliquity)), about(2, -tilt))
    np.testing.assert_allclose(pelvis_angles(own), [tilt, obliquity], atol=1e-9)
    np.testing.assert_allclose(pelvis_angles(multiply(about(2, heading), own)), [tilt, obliquity], atol=1e-9)


def test_standing_is_zero_and_its_offset_is_kept() -> None:
    crouched = about(2, np.radians(-25.0))
    orientations = pose()
    q = {s: x if s not in ("shank_l", "foot_l") else multiply(x, crouched) for s, x in orientations.q.items()}
    angles = measure_angles(Orientations(orientations.t_s, 100.0, q, orientations.valid, "test"), (0.0, 1.0))
    assert np.abs(angles.angles["knee_flexion_l"]).max() < 1e-9
    assert np.degrees(angles.zero_offset["knee_flexion_l"]) == pytest.approx(25.0)
    assert angles.zero == "standing"


def test_a_lost_segment_is_no_number_in_its_joints_only() -> None:
    orientations = pose()
    valid = dict(orientations.valid)
    valid["shank_r"] = np.arange(200) < 120
    angles = measure_angles(Orientations(orientations.t_s, 100.0, orientations.q, valid, "test"), (0.0, 1.0))
    assert np.isnan(angles.angles["knee_flexion_r"][120:]).all()
    assert np.isnan(angles.angles["ankle_dorsiflexion_r"][120:]).all()
    assert np.isfinite(angles.angles["hip_flexion_r"]).all()
    assert np.isfinite(angles.angles["knee_flexion_l"]).all()


def test_a_joint_without_both_segments_is_left_out_with_a_reason() -> None:
    orientations = pose()
    segment_names: tuple[Segment, ...] = ("thigh_l", "shank_l")
    q = {s: orientations.q[s] for s in segment_names}
    angles = measure_angles(Orientations(orientations.t_s, 100.0, q, orientations.valid, "test"), (0.0, 1.0))
    assert set(angles.angles) == {"knee_flexion_l", "knee_adduction_l", "knee_rotation_l"}
    assert {n.code for n in angles.notices} == {"joint_missing"}


def test_gimbal_is_flagged_beyond_eighty_degrees_only() -> None:
    assert not measure_angles(pose(thigh_r=about(0, np.radians(79.0))), (0.0, 1.0)).notices
    flagged = measure_angles(pose(thigh_r=about(0, np.radians(84.0))), (0.0, 1.0)).notices
    assert {n.code for n in flagged} == {"gimbal"}
    assert flagged[0].t_s == pytest.approx(1.0)


def test_a_standing_without_signal_is_told() -> None:
    orientations = pose()
    valid = dict(orientations.valid)
    valid["foot_l"] = np.arange(200) >= 100
    angles = measure_angles(Orientations(orientations.t_s, 100.0, orientations.q, valid, "test"), (0.0, 1.0))
    assert "no_standing_zero" in {n.code for n in angles.notices}
    assert "ankle_dorsiflexion_l" not in angles.angles


@pytest.mark.slow
def test_angles_of_the_true_poses_are_the_true_angles() -> None:
    """The simulator takes its angles from rotation matrices on its own."""
    _, truth = simulated("comfortable")
    valid = {s: np.ones(len(truth.t_s), bool) for s in truth.q}
    angles = measure_angles(Orientations(truth.t_s, truth.rate_hz, truth.q, valid, "truth"), truth.zero)
    for name, x in truth.angles.items():
        raw = angles.angles[name] + angles.zero_offset[name]
        np.testing.assert_allclose(np.angle(np.exp(1j * (raw - x))), 0.0, atol=1e-9)


def test_sign_table_covers_every_joint_in_three_planes() -> None:
    assert set(SIGNS) == {"hip", "knee", "ankle"}
    assert all(len(rows) == 3 for rows in SIGNS.values())


def test_goniometer_angles_stay_beside_the_angles() -> None:
    bent = pose(shank_l=about(2, -0.3))
    angles = measure_angles(bent, (0.0, 1.0), standing_deg={"knee_flexion_l": 8.0})
    assert angles.standing_deg == {"knee_flexion_l": 8.0}
    assert angles.angles["knee_flexion_l"][0] == pytest.approx(0.0)
    assert angles.zero == "standing"


def test_headings_are_continuous_over_turns_and_only_of_sensors() -> None:
    n = 400
    turning = np.linspace(0.0, 4.0 * np.pi, n)
    q = multiply(about(2, turning), np.tile(NEUTRAL, (n, 1)))
    valid: dict[Segment, Bools] = {"pelvis": np.ones(n, bool)}
    valid["pelvis"][50:60] = False
    course = compute_headings(Orientations(np.arange(n) / 100.0, 100.0, {"pelvis": q}, valid, "test"))
    assert set(course) == {"pelvis"}
    assert np.isnan(course["pelvis"][50:60]).all()
    known_finite = np.isfinite(course["pelvis"])
    np.testing.assert_allclose((course["pelvis"] - turning)[known_finite], course["pelvis"][0], atol=1e-9)
