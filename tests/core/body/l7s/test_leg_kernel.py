"""The compiled legs, against the equations of the paper written with whole arrays."""

from __future__ import annotations

import numpy as np

from sagittal.core.body.l7s.legs import FIGURE, HIP_SIDE, LEGS, solve_legs
from sagittal.core.frames import FOOT, SHANK, THIGH, Floats
from sagittal.core.rotation import from_matrix
from tests.core.body.l7s.test_inputs import MODEL, N, poses


def unit(v: Floats) -> Floats:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def test_legs_are_those_of_the_law_of_cosines() -> None:
    """Sy 2021 eq 40–44."""
    R, p = poses()
    legs = solve_legs(R, p, MODEL)
    q, position = ({s: x[:, i] for i, s in enumerate(FIGURE)} for x in (legs.q, legs.p))
    np.testing.assert_allclose(q["pelvis"], from_matrix(R[:, 0] @ MODEL.to_isb("pelvis")), atol=1e-12)
    np.testing.assert_array_equal(position["pelvis"], p[:, 0])
    straight = 0
    for leg, side in enumerate(LEGS):
        y = R[:, 1 + leg, :, 1]
        hip = p[:, 0] + 0.5 * HIP_SIDE[side] * MODEL.hip_width * R[:, 0, :, 1]
        ankle = p[:, 1 + leg] - 0.5 * MODEL.foot * R[:, 1 + leg, :, 2]
        tau = hip - ankle
        d = np.linalg.norm(tau, axis=1)
        cosine = (MODEL.shank**2 + d**2 - MODEL.thigh**2) / (2.0 * MODEL.shank * d)
        straight += int((cosine > 1.0).sum())
        angle = np.arccos(np.minimum(cosine, 1.0))[:, None]
        z_shank = np.cos(angle) * unit(tau) + np.sin(angle) * np.cross(y, unit(tau))
        knee = ankle + MODEL.shank * z_shank
        for segment, z, origin in ((SHANK[side], z_shank, knee), (THIGH[side], unit(hip - knee), hip)):
            x = unit(np.cross(y, z))
            frame = np.stack((x, np.cross(z, x), z), axis=-1) @ MODEL.to_isb(segment)
            np.testing.assert_allclose(q[segment], from_matrix(frame), atol=1e-12)
            np.testing.assert_allclose(position[segment], origin, atol=1e-12)
        foot = FOOT[side]
        np.testing.assert_allclose(q[foot], from_matrix(R[:, 1 + leg] @ MODEL.to_isb(foot)), atol=1e-12)
        np.testing.assert_allclose(position[foot], ankle, atol=1e-12)
        np.testing.assert_allclose(legs.reach[:, leg], d, atol=1e-12)
        np.testing.assert_allclose(legs.hinge[:, leg], np.sum(y * tau, axis=1), atol=1e-12)
    assert 0 < straight < 2 * N
    assert tuple(q) == FIGURE
