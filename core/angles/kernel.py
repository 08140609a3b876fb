"""Joint angles, compiled: the same implementation for files and live recordings.

A live push holds ten samples: at that size numpy has ten times the overhead of the arithmetic, and some of
its functions round differently on vectors and scalars. A file is processed in one call.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import asin, atan2

import numba
import numpy as np
from numpy.typing import NDArray

from sagittal.core.angles.result import SIGNS, list_leg_joints
from sagittal.core.frames import SIDES, SUFFIX, Bools, Floats, Segment
from sagittal.core.rotation import compiled, wrap_angle


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _measure(q, is_known, pelvis, ends, sign, zero, out):  # type: ignore[no-untyped-def]
    """Write angles (T, 2 + 3 J) of segments q (T, n, 4); `ends` (J, 2), `sign` (J, 3), pelvis −1 = none."""
    half = np.sqrt(0.5)
    first = 2 if pelvis >= 0 else 0
    for k in range(q.shape[0]):
        if pelvis >= 0:
            out[k, 0] = out[k, 1] = np.nan
            if is_known[k, pelvis]:
                # in axes of neutral standing: its inverse is a quarter turn about −x
                w, x, y, z = q[k, pelvis]
                a, b, c, d = half * (w + x), half * (x - w), half * (y + z), half * (z - y)
                out[k, 0] = -atan2(2.0 * (b * c + a * d), 1.0 - 2.0 * (b * b + d * d))
                out[k, 1] = -asin(min(1.0, max(-1.0, -2.0 * (c * d - a * b))))
        for j in range(ends.shape[0]):
            proximal, distal = ends[j, 0], ends[j, 1]
            for c in range(3):
                out[k, first + 3 * j + c] = np.nan
            if not (is_known[k, proximal] and is_known[k, distal]):
                continue
            a0, a1, a2, a3 = q[k, proximal]
            b0, b1, b2, b3 = q[k, distal]
            w, x, y, z = compiled.multiply(a0, -a1, -a2, -a3, b0, b1, b2, b3)
            flexion = atan2(-2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z))
            frontal = asin(min(1.0, max(-1.0, 2.0 * (y * z + w * x))))
            turned = atan2(-2.0 * (x * z - w * y), 1.0 - 2.0 * (x * x + y * y))
            out[k, first + 3 * j] = sign[j, 0] * flexion
            out[k, first + 3 * j + 1] = sign[j, 1] * frontal
            out[k, first + 3 * j + 2] = sign[j, 2] * turned
        for i in range(out.shape[1]):
            out[k, i] = compiled.wrap_angle(out[k, i] - zero[i])


@dataclass(frozen=True, eq=False)
class AngleKernel:
    """The joint angles available for a set of segments, and their computation.

    Parameters
    ----------
    names : as in `JointAngles`. ends : (J, 2) columns of the proximal and distal segment. sign : (J, 3).
        pelvis : its column, −1 = none. estimated : of each name, whether a segment of it has no sensor.
    """

    names: tuple[str, ...]
    ends: NDArray[np.int64]
    sign: Floats
    pelvis: int
    estimated: tuple[bool, ...]

    @classmethod
    def between(cls, measured: Sequence[Segment], figure: Sequence[Segment] = ()) -> AngleKernel:
        """All angles between these segments; the columns to measure are those of `measured`, then of
        `figure`.

        Parameters
        ----------
        measured : segments with a sensor; angles between two of them are measured.
        figure : segments of a pose estimate with more segments; angles that lack a sensor are computed from
        it, both
            ends.
        """
        sources = [({s: i for i, s in enumerate(measured)}, False),
                   ({s: len(measured) + i for i, s in enumerate(figure)}, True)]  # fmt: skip
        names: list[str] = []
        estimated: list[bool] = []
        ends, sign, pelvis = [], [], -1
        for column, guessed in sources:
            if "pelvis" in column:
                pelvis, names, estimated = (
                    column["pelvis"],
                    ["pelvis_tilt", "pelvis_obliquity"],
                    [guessed] * 2,
                )
                break
        for side in SIDES:
            for joint, proximal, distal in list_leg_joints(side):
                for column, guessed in sources:
                    if proximal in column and distal in column:
                        ends.append((column[proximal], column[distal]))
                        sign.append([right if side == "right" else left for _, right, left in SIGNS[joint]])
                        names += [f"{base}_{SUFFIX[side]}" for base, _, _ in SIGNS[joint]]
                        estimated += [guessed] * 3
                        break
        return cls(
            tuple(names),
            np.array(ends, np.int64).reshape(-1, 2),
            np.array(sign, np.float64).reshape(-1, 3),
            pelvis,
            tuple(estimated),
        )

    def measure(self, q: Floats, is_known: Bools, zero: Floats | None = None) -> Floats:
        """Angles (T, names) in rad, −π to π, of segments q (T, n, 4) to W; NaN where not `is_known` (T, n).

        Parameters
        ----------
        zero : (names,) rad, offset to subtract.
        """
        out = np.empty((len(q), len(self.names)))
        _measure(
            np.ascontiguousarray(q), np.ascontiguousarray(is_known), self.pelvis, self.ends, self.sign,
            np.zeros(len(self.names)) if zero is None else zero, out,
        )  # fmt: skip
        return out


def compile_angle_kernel() -> None:
    """Compile the kernel or load it from the cache, so that the first recording is not delayed."""
    q = np.tile([1.0, 0.0, 0.0, 0.0], (1, 2, 1))
    AngleKernel.between(("pelvis", "thigh_l")).measure(q, np.ones((1, 2), np.bool_))


def mean_angles(angles: Floats) -> Floats:
    """Circular mean (k,) in rad of angles (T, k) over their finite samples; 0 if there are none."""
    finite = np.where(np.isfinite(angles), angles, 0.0)
    n = np.isfinite(angles)
    return np.asarray(np.arctan2((np.sin(finite) * n).sum(axis=0), (np.cos(finite) * n).sum(axis=0)))


def subtract_zero(angles: Floats, zero: Floats | float) -> Floats:
    """Angles (T, k) in rad relative to a zero (k,), or (T,) relative to a scalar, −π to π."""
    return wrap_angle(np.asarray(angles - zero))
