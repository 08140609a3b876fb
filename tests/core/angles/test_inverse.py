"""Angles put into segments and measured back."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.angles import SIGNS, cardan_zxy, list_leg_joints, pelvis_angles
from sagittal.core.angles.inverse import leg_orientations, pelvis_orientation
from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.norms import adult_kinematics
from sagittal.core.rotation import conjugate, multiply, rotate


def measured(curves: dict[str, Floats], side: Side) -> dict[str, Floats]:
    """Angles of the posture of these curves, by `sagittal.core.angles`, with the names of the curves."""
    pelvis = pelvis_orientation(curves, side)
    own = 1.0 if side == "right" else -1.0
    tilt, obliquity = pelvis_angles(pelvis)
    x, y, _ = rotate(pelvis, np.array([0.0, 0.0, 1.0])).T
    result = {
        "pelvis_tilt": tilt,
        "pelvis_obliquity": own * obliquity,
        "pelvis_rotation": own * (np.unwrap(np.arctan2(y, x)) + np.pi / 2),
    }
    q = {s: multiply(pelvis, turn) for s, turn in leg_orientations(curves, side).items()}
    q["pelvis"] = pelvis
    for joint, proximal, distal in list_leg_joints(side):
        abc = cardan_zxy(multiply(conjugate(q[proximal]), q[distal]))
        for (name, right, left), value in zip(SIGNS[joint], abc.T, strict=True):
            result[name] = (right if side == "right" else left) * value
    return result


@pytest.mark.parametrize("side", SIDES)
def test_the_norm_walks_with_the_angles_of_the_norm(side: Side) -> None:
    bands = adult_kinematics(None).bands
    curves = {name: np.radians(band.mean_deg) for name, band in bands.items() if name != "foot_progression"}
    measurement = measured(curves, side)
    assert len(curves) == 8
    for name, value in measurement.items():
        np.testing.assert_allclose(value, curves.get(name, np.zeros(101)), atol=1e-9, err_msg=name)


@pytest.mark.parametrize("side", SIDES)
def test_any_angles_come_back(side: Side) -> None:
    rng = np.random.default_rng(5)
    names = ["pelvis_tilt", "pelvis_obliquity", "pelvis_rotation"]
    names += [name for rows in SIGNS.values() for name, _, _ in rows]
    curves = {name: rng.uniform(-1.2, 1.2, 300) for name in names}
    measurement = measured(curves, side)
    assert set(measurement) == set(names)
    for name, value in curves.items():
        np.testing.assert_allclose(
            np.angle(np.exp(1j * (measurement[name] - value))), 0, atol=1e-9, err_msg=name
        )


def test_flexion_brings_the_thigh_forward_and_the_foot_up() -> None:
    for side in SIDES:
        q = leg_orientations({"hip_flexion": np.array([0.5])}, side)
        thigh = f"thigh_{side[0]}"
        assert rotate(q[thigh], np.array([0.0, -1.0, 0.0]))[0, 0] > 0.4  # type: ignore[index]
