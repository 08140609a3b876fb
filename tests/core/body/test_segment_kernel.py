"""From a sensor to its segment: orientation by the mount, origin by the arm."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.body.segment_kernel import write_segments
from sagittal.core.rotation import conjugate, exp, multiply, rotate


def test_segments_are_where_their_sensors_say() -> None:
    rng = np.random.default_rng(6)
    T, n = 4, 3
    position, place = rng.normal(0.0, 1.0, (T, n, 3)), rng.normal(0.0, 0.2, (n, 3))
    turned, mount = exp(rng.normal(0.0, 1.0, (T, n, 3))), exp(rng.normal(0.0, 1.0, (n, 3)))
    q, p = np.empty((T, n, 4)), np.empty((T, n, 3))
    write_segments(position, turned, mount, place, q, p)
    expected = multiply(turned, conjugate(mount)[None])
    np.testing.assert_allclose(q, expected, atol=1e-12)
    np.testing.assert_allclose(p + rotate(q, np.broadcast_to(place, p.shape)), position, atol=1e-12)


def test_a_sensor_in_the_origin_along_its_axes_is_the_segment() -> None:
    position, turned = np.ones((1, 1, 3)), np.array([[[0.6, 0.8, 0.0, 0.0]]])
    q, p = np.empty((1, 1, 4)), np.empty((1, 1, 3))
    write_segments(position, turned, np.array([[1.0, 0.0, 0.0, 0.0]]), np.zeros((1, 3)), q, p)
    assert q == pytest.approx(turned)
    assert p == pytest.approx(position)
