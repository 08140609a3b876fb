from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.frames import GRAVITY, SIDES
from sagittal.core.rotation import angle_between, exp, multiply, rotate
from sagittal.core.simulate.potter import ACC_SD, GYR_SD, LEG, STRIDE_M, PotterWalk, potter_walk


@pytest.fixture(scope="module")
def walk() -> PotterWalk:
    return potter_walk(strides=6)


def test_the_hips_close(walk: PotterWalk) -> None:
    for hip in walk.hips.values():
        ends = [
            walk.p[:, i] + rotate(walk.q[:, i], r)
            for i, r in ((hip.proximal, hip.in_proximal_m), (hip.distal, hip.in_distal_m))
        ]
        assert np.abs(ends[0] - ends[1]).max() < 1e-12


def test_the_stance_foot_is_fixed_and_still_means_still(walk: PotterWalk) -> None:
    assert 0.05 < walk.still.mean() < 0.4
    assert np.abs(walk.v[walk.still]).max() < 2e-3
    assert np.abs(np.linalg.norm(walk.acc[walk.still], axis=-1) - GRAVITY).max() < 0.1
    for side in SIDES:
        first, second = walk.footfalls[side][:2]
        step = (second - first) // 2
        assert np.ptp(walk.p[first : first + step, LEG[side]], axis=0).max() < 1e-9


def test_strides_and_angles_are_the_paper_s(walk: PotterWalk) -> None:
    """Stride 0.73 m at 0.33 m/s, half angle 11.44° (docs/science/simulation.md, "Potter's walker")."""
    lengths, widths = walk.strides()
    assert len(lengths) == 2 * 5
    assert lengths == pytest.approx(STRIDE_M, abs=1e-12)
    assert widths == pytest.approx(0.39, abs=1e-12)
    right = walk.footfalls["right"]
    speed = (walk.p[right[-1], 0, 0] - walk.p[right[0], 0, 0]) / (walk.t_s[right[-1]] - walk.t_s[right[0]])
    assert speed == pytest.approx(0.33, rel=1e-3)
    for flexion in walk.hip_flexion.values():
        assert np.degrees(flexion.min()) == pytest.approx(-11.44, abs=0.01)
        assert 11.44 < np.degrees(flexion.max()) < 15.0


@pytest.mark.sweep
def test_the_signals_integrate_to_the_truth(walk: PotterWalk) -> None:
    dt = 1.0 / walk.rate_hz
    for i in range(3):
        q, v, p = walk.q[0, i], walk.v[0, i], walk.p[0, i]
        for k in range(1, len(walk.t_s)):
            q_next = multiply(q, exp(0.5 * (walk.gyr[k - 1, i] + walk.gyr[k, i]) * dt))
            a = 0.5 * (rotate(q, walk.acc[k - 1, i]) + rotate(q_next, walk.acc[k, i])) - [0.0, 0.0, GRAVITY]
            p = p + v * dt + 0.5 * a * dt**2
            v, q = v + a * dt, q_next
        assert angle_between(q, walk.q[-1, i]) < 1e-5
        assert np.abs(p - walk.p[-1, i]).max() < 2e-3


def test_noise_is_white_and_of_the_paper_s_size(walk: PotterWalk) -> None:
    acc, gyr = walk.add_noise(seed=3)
    assert (acc - walk.acc).std() == pytest.approx(ACC_SD, rel=0.01)
    assert (gyr - walk.gyr).std() == pytest.approx(GYR_SD, rel=0.01)
    assert np.array_equal(walk.add_noise(seed=3)[1], gyr)
