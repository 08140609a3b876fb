"""From sensors to segments: orientation less the mounting, origin less the sensor's place."""

from __future__ import annotations

import numpy as np

from sagittal.core.body import BodyModel
from sagittal.core.body.tree import PRESETS, person_tree
from sagittal.core.rotation import conjugate, exp, multiply, rotate, to_matrix

SEGMENTS = PRESETS["lower_body7"]


def test_segments_are_where_the_mounted_sensors_say() -> None:
    rng = np.random.default_rng(6)
    mounts = dict(zip(SEGMENTS, to_matrix(exp(rng.normal(0.0, 1.0, (7, 3)))), strict=True))
    tree = person_tree(BodyModel.from_height(1.7), mounts, SEGMENTS)
    q, p = exp(rng.normal(0.0, 1.0, (50, 7, 3))), rng.normal(0.0, 1.0, (50, 7, 3))
    turned, origin = tree.segments(p, q)
    np.testing.assert_allclose(turned, multiply(q, conjugate(tree.q_mount)), atol=1e-14)
    np.testing.assert_allclose(origin, p - rotate(turned, tree.place), atol=1e-13)
    np.testing.assert_array_equal(tree.segment_q(q), turned)
    np.testing.assert_array_equal(tree.segment_origin(p, q), origin)
    one, place = tree.segments(p[0], q[0])
    np.testing.assert_array_equal(one, turned[0])
    np.testing.assert_array_equal(place, origin[0])
