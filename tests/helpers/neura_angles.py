"""Agreement of joint angles on neura_walk with frames of Vicon joint centres.

Scored as in docs/science/real-recordings.md, "Limits": rows 1110 to 2080, one lag of −2 to +6 samples for all
joints, standing is rows 300 to 1000. "offset removed" is the standard deviation of the error, "zeroed" has
the standing means of both sides subtracted.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from sagittal.core.frames import Floats
from tests.data import data_folder

WALK, STANDING = slice(1110, 2080), slice(300, 1000)
LAGS = range(-2, 7)
PLANES = (
    ("hip_flexion", "knee_flexion", "ankle_dorsiflexion"),
    ("hip_adduction", "knee_adduction", "ankle_inversion"),
    ("hip_rotation", "knee_rotation", "ankle_rotation"),
)


@dataclass(frozen=True)
class Score:
    """Agreement of one angle in degrees: raw, zeroed at standing, offset removed, and correlation."""

    raw: float
    zeroed: float
    offset_removed: float
    r: float


@cache
def reference() -> dict[str, Floats]:
    """The reference angles by name, degrees."""
    table = np.genfromtxt(data_folder("neura_walk") / "reference_angles.csv", delimiter=",", names=True)
    names = table.dtype.names or ()
    return {n.removesuffix("_deg"): np.asarray(table[n]) for n in names if n.endswith("_deg")}


def scores(result: dict[str, Floats]) -> tuple[int, dict[str, Score]]:
    """The one lag for all joints, and how each angle agrees."""
    truth = reference()
    shared = min(
        LAGS, key=lambda k: sum(_error(result[n], truth[n], k)[WALK].std() for n in _names(PLANES[0]))
    )
    out = {}
    for name in (n for plane in PLANES for n in _names(plane)):
        e = _error(result[name], truth[name], shared)
        walk, standing = e[WALK], e[STANDING].mean()
        out[name] = Score(
            raw=float(np.sqrt(np.mean(walk**2))),
            zeroed=float(np.sqrt(np.mean((walk - standing) ** 2))),
            offset_removed=float(walk.std()),
            r=float(np.corrcoef(np.roll(result[name], -shared)[WALK], truth[name][WALK])[0, 1]),
        )
    return shared, out


def _names(plane: tuple[str, ...]) -> list[str]:
    return [f"{n}_{side}" for n in plane for side in "rl"]


def _error(x: Floats, y: Floats, lag: int) -> Floats:
    return np.asarray((np.roll(x, -lag) - y + 180.0) % 360.0 - 180.0)
