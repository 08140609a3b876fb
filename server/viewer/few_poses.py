"""Rotations of a few poses: arithmetic of sagittal.core.rotation with a minimum of numpy calls.

For a handful of quaternions the overhead of calls dominates.
"""

from __future__ import annotations

from math import cos, sin
from typing import Final

import numpy as np

from sagittal.core import rotation
from sagittal.core.frames import Floats

_UNITS: Final = np.eye(4)

_BASIS: Final = rotation.multiply(
    rotation.multiply(_UNITS[:, None, None], np.concatenate((np.zeros((3, 1)), np.eye(3)), axis=1)),
    rotation.conjugate(_UNITS)[:, None],
)[..., 1:]
"""(4, 4, 3, 3): Σ q[i] q[j] of it is R transposed, since q ⊗ v ⊗ q* is linear in both q."""

_ROTATED: Final = np.ascontiguousarray(_BASIS.transpose(0, 1, 3, 2).reshape(16, 9))


def find_matrices(q: Floats) -> Floats:
    """Return the rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    pairs = (q[..., :, None] * q[..., None, :]).reshape(*q.shape[:-1], 16)
    return np.asarray((pairs @ _ROTATED).reshape(*q.shape[:-1], 3, 3))


def turn_about_z(angle: float, q: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """Return a rotation by `angle` rad about z ⊗ q."""
    c, s = cos(angle / 2), sin(angle / 2)
    w, x, y, z = q
    return c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w
