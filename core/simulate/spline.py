"""Velocities and accelerations of sampled poses: exact derivatives of quintic interpolating splines.

Ground truth and signals come from one curve, so integrating the signals reproduces the truth
(docs/science/simulation.md, "Signals").
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import make_interp_spline

from sagittal.core.frames import Floats
from sagittal.core.rotation import conjugate, multiply, normalise


def differentiate_pose(t: Floats, p: Floats, q: Floats) -> tuple[Floats, Floats, Floats]:
    """Differentiate a pose at its own samples.

    Parameters
    ----------
    t : (n,) s, n ≥ 6. p : (n, 3) m. q : (n, 4) unit quaternions, sign-continuous, body to world.

    Returns
    -------
    Velocity (n, 3) m/s and acceleration (n, 3) m/s² in the world, angular rate (n, 3) rad/s in the body: ω =
    vec(2 q* ⊗ q̇); deviations of the norm of q caused by the spline affect only the scalar part.
    """
    spline = make_interp_spline(t, np.column_stack((p, q)), k=5)
    first = spline.derivative(1)(t)
    acceleration = spline.derivative(2)(t)[:, :3]
    rate = 2.0 * multiply(conjugate(normalise(q)), first[:, 3:])[:, 1:]
    return np.ascontiguousarray(first[:, :3]), np.ascontiguousarray(acceleration), rate


def sign_continuous(q: Floats) -> Floats:
    """The same rotations (n, 4) without sign flips from sample to sample."""
    flips = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0)
    return q * np.concatenate(([1.0], np.cumprod(flips)))[:, None]


def resample_pose(t: Floats, p: Floats, q: Floats, times: Floats) -> tuple[Floats, Floats]:
    """The pose between its samples: p (m, 3) and unit q (m, 4) at times `times` (m,) within those of t."""
    pose = make_interp_spline(t, np.column_stack((p, q)), k=5)(times)
    return np.ascontiguousarray(pose[:, :3]), normalise(pose[:, 3:])
