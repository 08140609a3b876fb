"""Rotations of a moment are those of sagittal.core.rotation."""

from __future__ import annotations

import numpy as np

from sagittal.core import rotation
from sagittal.server.viewer.few_poses import find_matrices, turn_about_z

Q = rotation.normalise(np.random.default_rng(4).normal(size=(3, 5, 4)))


def test_matrices_are_those_of_the_quaternions() -> None:
    np.testing.assert_allclose(find_matrices(Q), rotation.to_matrix(Q), atol=1e-14)
    np.testing.assert_allclose(find_matrices(Q[0, 0]), rotation.to_matrix(Q[0, 0]), atol=1e-14)


def test_a_turn_about_the_vertical_comes_before_the_rest() -> None:
    w, x, y, z = Q[1, 2].tolist()
    expected = rotation.multiply(rotation.about(2, 2.1), Q[1, 2])
    np.testing.assert_allclose(turn_about_z(2.1, (w, x, y, z)), expected, atol=1e-14)
