from __future__ import annotations

import numpy as np

from sagittal.core.rotation import about, multiply
from sagittal.core.simulate.spline import differentiate_pose, sign_continuous


def test_a_turning_body_on_a_circle_has_the_textbook_signals() -> None:
    t = np.arange(0.0, 2.0, 0.0025)
    spin, radius = 3.0, 0.4
    p = radius * np.stack((np.cos(spin * t), np.sin(spin * t), 0.0 * t), axis=-1)
    q = multiply(about(2, spin * t), about(0, 0.3))
    velocity, acceleration, rate = differentiate_pose(t, p, q)
    inside = slice(5, -5)
    assert np.allclose(velocity[inside], spin * p[inside][:, [1, 0, 2]] * [-1, 1, 0], atol=1e-9)
    assert np.allclose(acceleration[inside], -(spin**2) * p[inside], atol=1e-6)
    assert np.allclose(rate[inside], spin * np.array([0.0, np.sin(0.3), np.cos(0.3)]), atol=1e-9)


def test_sign_flips_are_removed() -> None:
    q = about(1, np.linspace(0.0, 12.0, 200))
    flipped = q * np.where(np.arange(200) % 7 < 3, -1.0, 1.0)[:, None]
    assert np.allclose(np.abs(np.sum(sign_continuous(flipped) * q, axis=1)), 1.0)
    assert (np.sum(np.diff(sign_continuous(flipped), axis=0) ** 2, axis=1) < 0.1).all()
