"""The flexion axis by PCA: oracles of docs/science/calibration.md, sign rules, the alarm where there is no
axis."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.calibration.gyro_pca import about_vertical, flexion_axis, gait_margin, sagittal_angle
from sagittal.core.calibration.standing import vertical_frame
from sagittal.core.errors import CalibrationError
from sagittal.core.frames import Floats, Segment
from sagittal.core.rotation import exp, from_matrix, log, normalise, to_matrix


def flexing(R_sensor_segment: Floats, n: int = 1000, seed: int = 0) -> tuple[Floats, Floats]:
    """Rates and specific force at rest of a sensor on a segment that turns about its z, with sensor noise."""
    rng = np.random.default_rng(seed)
    rate = np.zeros((n, 3))
    rate[:, 2] = 2.0 * np.sin(np.arange(n) * 0.06)
    force = np.tile([0.0, 9.81, 0.0], (200, 1)) @ R_sensor_segment.T
    return rate @ R_sensor_segment.T + 0.02 * rng.standard_normal((n, 3)), (
        force + 0.05 * rng.standard_normal((200, 3))
    )


def test_any_mounting_is_found_within_the_oracle() -> None:
    """300 random mountings: median 0.03°, largest 0.10°, up to half a turn."""
    rng = np.random.default_rng(1)
    off = []
    for k in range(300):
        truth = to_matrix(normalise(rng.standard_normal(4)))
        rate, force = flexing(truth.T, seed=k)
        up = force.mean(axis=0)
        R_vertical = vertical_frame(up / np.linalg.norm(up))
        result = flexion_axis(rate, R_vertical, "shank_l")
        R = about_vertical(result.gamma) @ R_vertical
        pair = [R, about_vertical(np.pi) @ R]
        off.append(min(float(np.linalg.norm(log(from_matrix(x @ truth.T)))) for x in pair))
        assert result.rho > 0.98
    assert np.degrees(np.median(off)) < 0.06
    assert np.degrees(max(off)) < 0.2


def test_a_movement_without_an_axis_is_an_error_with_its_share() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(CalibrationError) as caught:
        flexion_axis(rng.standard_normal((1000, 3)), np.eye(3), "foot_l")
    assert caught.value.code == "not_single_axis"
    assert caught.value.sensor == "foot_l"


def test_about_vertical_turns_the_component_onto_z() -> None:
    for angle in np.linspace(-3, 3, 13):
        p = np.array([np.cos(angle), 0.0, np.sin(angle)])
        gamma = float(np.arctan2(-p[0], p[2]))
        np.testing.assert_allclose(about_vertical(gamma) @ p, [0, 0, 1], atol=1e-12)
        np.testing.assert_allclose(
            about_vertical(gamma), to_matrix(exp(np.array([0.0, gamma, 0.0]))), atol=1e-12
        )


def test_sagittal_angle_is_positive_with_the_distal_end_forward() -> None:
    """A thigh whose knee is forward leans its y axis back: the vertical leans to its x."""
    lean = np.radians(20.0)
    up = np.array([[np.sin(lean), np.cos(lean), 0.0]])
    assert sagittal_angle(up, np.eye(3))[0] == pytest.approx(lean)


@pytest.mark.parametrize(("segment", "sign"), [("thigh_l", 1.0), ("shank_r", -1.0), ("foot_l", -1.0)])
def test_gait_margin_wants_thigh_forward_and_the_others_back(segment: str, sign: float) -> None:
    phase = np.linspace(0, 20, 2000)
    angle = np.radians(25.0 * np.sin(phase) + sign * 10.0)
    everywhere = np.ones(2000, bool)
    assert gait_margin(angle, everywhere, segment) == pytest.approx(np.radians(20.0), abs=0.02)  # type: ignore[arg-type]
    assert gait_margin(-angle, everywhere, segment) < 0  # type: ignore[arg-type]


@pytest.mark.parametrize(("aside", "together"), [(0.3, 0.0), (0.3, 0.4), (0.6, 0.2)])
def test_motion_aside_bends_the_axis_by_its_correlation_and_the_share_hardly_tells(
    aside: float, together: float
) -> None:
    """The principal axis deviates by ½ atan(2cσ / (1 − σ²)), σ and c of the lateral motion."""
    rng = np.random.default_rng(2)
    z = rng.standard_normal(40_000)
    x = aside * (together * z + np.sqrt(1 - together**2) * rng.standard_normal(len(z)))
    result = flexion_axis(np.column_stack([x, 0.3 * rng.standard_normal(len(z)), z]), np.eye(3), "shank_l")
    bend = 0.5 * np.arctan2(2 * together * aside, 1 - aside**2)
    off = (result.gamma + bend + np.pi / 2) % np.pi - np.pi / 2
    assert abs(np.degrees(off)) < 1.0 if aside < 0.5 else abs(np.degrees(off)) < 2.5
    assert result.rho > (0.9 if aside < 0.5 else 0.6)


@pytest.mark.parametrize("segment", ["thigh_l", "thigh_r", "shank_l", "shank_r", "foot_l", "foot_r"])
@pytest.mark.parametrize("amplitude", [15.0, 25.0, 40.0])
def test_the_sign_of_a_gait_is_right_in_every_mounting(segment: Segment, amplitude: float) -> None:
    """18 cells of 60 mountings each: the right one of two axes half a turn apart has the greater margin."""
    phase = np.linspace(0.0, 8 * 2 * np.pi, 1000)
    ahead = 1.0 if segment.startswith("thigh") else -1.0
    lean = np.radians(amplitude * (np.sin(phase) + 0.25 * ahead * (1.0 - np.cos(2 * phase))))
    up = np.column_stack([np.sin(lean), np.cos(lean), np.zeros_like(lean)])
    rng = np.random.default_rng(3)
    everywhere = np.ones(len(lean), np.bool_)
    for _ in range(60):
        R = to_matrix(normalise(rng.standard_normal(4)))
        observations = up @ R
        right, turned = (
            gait_margin(sagittal_angle(observations, about_vertical(turn) @ R), everywhere, segment)
            for turn in (0.0, np.pi)
        )
        assert right > np.radians(5.0)
        assert turned < 0.0
