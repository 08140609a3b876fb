"""Terms of a thigh, a shank and a foot that share a knee and an ankle, made up sample by sample."""

from __future__ import annotations

from typing import Final

import numpy as np

from sagittal.core.agreement.terms import LevelMotion, TermsPart
from sagittal.core.frames import Floats, Segment

RATE_HZ: Final = 50.0
KNEE: Final = np.array([0.0, -0.2, 0.03]), np.array([0.01, 0.22, 0.0])
"""In the axes of thigh and shank, m."""
ANKLE: Final = np.array([0.02, -0.18, 0.0]), np.array([-0.1, 0.05, 0.01])
"""In the axes of shank and foot, m."""


def make_terms(seconds: int = 12, noise: float = 0.02) -> dict[Segment, TermsPart]:
    """Whatever the places weigh is drawn; the specific force of each sensor follows from its joint."""
    rng = np.random.default_rng(3)
    n = round(seconds * RATE_HZ)

    def turning() -> Floats:
        return 8.0 * rng.standard_normal((n, 3, 3))

    K = {"thigh_l": turning(), "shank_l": turning(), "foot_l": turning()}
    f = {"thigh_l": 4.0 * rng.standard_normal((n, 3))}
    knee = f["thigh_l"] + K["thigh_l"] @ KNEE[0]
    f["shank_l"] = knee - K["shank_l"] @ KNEE[1]
    f["foot_l"] = f["shank_l"] + K["shank_l"] @ ANKLE[0] - K["foot_l"] @ ANKLE[1]
    segments: tuple[Segment, ...] = ("thigh_l", "shank_l", "foot_l")
    still = LevelMotion(np.zeros((n, 4)), np.zeros((3, n)), np.zeros((n, 3)))
    return {
        s: TermsPart(
            still,
            np.concatenate((K[s], (f[s] + noise * rng.standard_normal((n, 3)))[:, :, None]), axis=2),
            np.ones(n, np.bool_),
            RATE_HZ,
        )
        for s in segments
    }
