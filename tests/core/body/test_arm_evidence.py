"""What two sensors beside a joint say of their arms: made from known arms, and where they hardly walked."""

from __future__ import annotations

import numpy as np

from sagittal.core.body.arm_evidence import ARM, ARMS, SensorView, ask_joint
from sagittal.core.body.arm_params import ArmParams
from sagittal.core.frames import Floats

ARMS_TO_JOINT = np.array([0.0, -0.2, 0.05, 0.02, 0.25, -0.04])
RATE_HZ = 25.0


def view(terms: Floats, offset: Floats) -> SensorView:
    """A sensor whose points move as `terms`, without skin."""
    n = len(terms)
    M = np.concatenate((terms, offset[:, :, None]), axis=2)
    return SensorView(M, np.zeros((n, 3, 0)), 0.0, np.ones(n, np.bool_))


def beside(n: int) -> tuple[SensorView, SensorView]:
    """Two sensors that see the acceleration of the same point at the ends of `ARMS_TO_JOINT`."""
    rng = np.random.default_rng(2)
    a, b = 20.0 * rng.standard_normal((2, n, 3, 3))
    point = 5.0 * rng.standard_normal((n, 3))
    return view(a, point - a @ ARMS_TO_JOINT[:ARM]), view(b, point - b @ ARMS_TO_JOINT[ARM:])


def test_arms_are_found_from_the_acceleration_of_one_point() -> None:
    first, second = beside(500)
    nominal = ARMS_TO_JOINT + 0.02
    result = ask_joint(first, second, nominal, 0.05**2 * np.eye(ARMS), RATE_HZ, ArmParams())
    assert result is not None
    assert result.misfit < 0.01
    np.testing.assert_allclose(np.linalg.solve(result.L, result.h), ARMS_TO_JOINT, atol=1e-3)


def test_with_hardly_any_walking_a_joint_says_nothing() -> None:
    first, second = beside(int(ArmParams().least_s * RATE_HZ) - 1)
    assert ask_joint(first, second, ARMS_TO_JOINT, np.eye(ARMS), RATE_HZ, ArmParams()) is None
