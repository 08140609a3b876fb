"""Smoothed L7S over a whole recording: positions of pelvis and feet from past and future samples.

The filter uses only past samples. Its pelvis is ahead by a fraction of a step, and the pull to the standing
height lifts it in every step until the knee reaches its bound. With the whole recording the same measurements
form one least-squares problem in the positions of the three bodies at nodes 20 ms apart (docs/science/l7s.md,
"Both ways"). Orientations are the measured ones; accelerations are integrated twice between the nodes, so
that the unknowns are slow corrections.

Weights are densities: variance times twice the correlation time of the error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numba
import numpy as np

from sagittal.core.body.l7s.constraints import make_scratch, project_places
from sagittal.core.body.l7s.filter import L7sInputs, L7sTrack
from sagittal.core.body.l7s.foot_place import find_sensor_offsets
from sagittal.core.body.l7s.legs import LegModel
from sagittal.core.body.l7s.node_kernel import KEPT, move_nodes
from sagittal.core.errors import EstimationError
from sagittal.core.frames import Bools, Floats
from sagittal.core.message import Message

NODE_S: Final = 0.02
"""Time between nodes: a brisk walker's foot rests for some 40 ms. Half of it changes flexion by 0.1°."""

DENSITY: Final = 0.25
"""Of the error of a worn sensor's acceleration, m²/s³: 2° of tilt, 0.35 m/s², for 1 s. Four times
more or less changes flexion by up to 2°."""

DENSITY_LOST: Final = 100.0
"""While a sensor is lost: up to 20 m/s² for 0.1 s."""

DENSITY_UNWORN: Final = 2.0
"""Of a pelvis without a sensor: 2.5 m/s² RMS of comfortable walking for a sixth of a second."""

MID_PELVIS: Final = 0.1
"""Mid-pelvis over the feet, m² s. Real pelves leave that place in every step; this pull is slower than
0.2 Hz, so slower than the slowest steps. Ten times the filter's, which looks one way."""

PELVIS_HEIGHT: Final = 0.01
"""Standing height of the pelvis, m² s: the filter's 1 m² at 100 Hz."""

FOOT_HEIGHT: Final = (1e-6, 0.1)
"""Height of a foot at rest and on its way, m² s: the filter's variances at 100 Hz."""

REST_M: Final = 3e-4
"""A resting foot moves by less from node to node."""

HINGE: Final = 0.02
"""Distance of the hip from the plane of the foot, m² s: 10 cm, a toe-out of 7° more than the knee's, for 1 s.
What is left of it, the foot is turned by."""

CARRIED: Final = 0.997
"""Distance of hip and ankle of the leg that carries the body alone, of thigh and shank: 42 healthy adults
(core/norms/data/SOURCES.md, WBDS) bend this knee by 5.2 ± 5.2° from 15 to 45 % of the cycle."""

CARRIES: Final = 8e-5
"""Of that distance, m² s: 1 cm over a stance of 0.4 s."""

LONGER: Final = 1e-5
"""What a leg is longer than thigh and shank, m² s: 1 cm for 50 ms."""

ANYWHERE: Final = 10.0
"""Pull to the filter's places for what nothing else holds, m² s."""

PASSES: Final = 20
SETTLED_M: Final = 1e-4
"""Gauss–Newton ends when no node moves further, after 11 to 14 passes on right walks."""

PROJECTIONS: Final = 3


@dataclass(frozen=True, eq=False)
class WholeTrack:
    """Poses of BODIES that satisfy the constraints.

    Parameters
    ----------
    R : (n, 3, 3, 3) and p : (n, 3, 3) in Sy's frames. passes : number of Gauss–Newton iterations. moved :
    largest change of a position in the last, m. offsets : (2, 3) from each foot's sensor to the middle of the
    foot (`find_sensor_offsets`).
    """

    R: Floats
    p: Floats
    passes: int
    moved: float
    offsets: Floats


def smooth_track(
    track: L7sTrack,
    inputs: L7sInputs,
    valid: Bools,
    model: LegModel,
    rate_hz: float,
    offsets: Floats | None = None,
    first: int = 0,
) -> WholeTrack:
    """Estimate the positions of pelvis and feet over a recording, or a part of it.

    Parameters
    ----------
    track : of the filter on these inputs. valid : (n, 3) sensor available; ignored for a body without one.
        offsets : (2, 3) as `find_sensor_offsets`; None = estimated from these inputs. first : sample of the
        recording at which they begin.

    Raises
    ------
    EstimationError `l7s_diverged` if there is no solution or a constraint cannot be satisfied.
    """
    R, acc = inputs.R.copy(), inputs.acc.copy()
    density = np.where(valid, DENSITY, DENSITY_LOST)
    if inputs.worn == "2I":
        R[:, 0], acc[:, 0], density[:, 0] = _level_pelvis(R), 0.0, DENSITY_UNWORN
    n, dt = len(acc), 1.0 / rate_hz
    hop = find_hop(rate_hz)
    nodes = np.arange(0, n, hop)
    leg = model.thigh + model.shank
    lengths = np.array([0.5 * model.hip_width, 0.5 * model.foot, leg, CARRIED * leg])
    if offsets is None:
        offsets = find_sensor_offsets(inputs, valid, model, rate_hz)
    p, passes, moved = track.p.copy(), 0, 0.0
    if len(nodes) > 2:
        free = _integrate_twice(acc, dt)
        free[:, 1:] += np.einsum("nbij,bj->nbi", R[:, 1:], offsets)
        filtered = p[nodes].reshape(-1, 9)
        x, passes, moved = solve_nodes(
            filtered, filtered, free[nodes].reshape(-1, 9), np.ascontiguousarray(R[nodes]),
            np.maximum.reduceat(density, nodes, axis=0), np.minimum.reduceat(inputs.step, nodes, axis=0),
            hop * dt,
            lengths, np.array([model.hip_height, model.foot_height]),
        )  # fmt: skip
        p = free + _interpolate(x.reshape(-1, 3, 3) - free[nodes], nodes, n)
    if not np.isfinite(p).all():
        raise EstimationError("l7s_diverged", NOT_FOUND)
    failed = _project_all(R, p, lengths)
    if failed >= 0:
        failed += first
        raise EstimationError(
            "l7s_diverged",
            Message(
                "The leg constraints cannot be met at sample {failed}; check which foot each sensor "
                "is on and the body height.",
                failed=failed,
            ),
        )
    return WholeTrack(R, p, passes, moved, offsets)


def find_hop(rate_hz: float) -> int:
    """Number of samples between nodes."""
    return max(1, round(NODE_S * rate_hz))


NOT_FOUND: Final = (
    "The positions of pelvis and feet cannot be determined; check which foot each sensor is on and the "
    "body height."
)


def solve_nodes(
    x: Floats, pull: Floats, free: Floats, R: Floats, density: Floats, still: Bools, hop_s: float,
    lengths: Floats, heights: Floats,
) -> tuple[Floats, int, float]:  # fmt: skip
    """Positions (T, 9) of the nodes by Gauss–Newton, the number of iterations, and the largest change in the
    last, m.

    Parameters
    ----------
    x : (T, 9) initial values. pull : (T, 9) those of the filter. free : (T, 9) integrated displacements.
        density : (T, 3)
    and still : (T, 2) from each node to the next. lengths : half hip width, half foot, leg, supporting leg.
        heights : pelvis, foot.

    Raises
    ------
    EstimationError `l7s_diverged` without a solution.
    """
    x = x.copy()
    bent = np.zeros_like(x)
    bent[1:-1] = free[2:] - 2.0 * free[1:-1] + free[:-2]
    stiff = np.zeros((len(x) + 1, 3))
    stiff[1:-2] = 1.0 / (np.maximum(density[:-2], density[1:-1]) * hop_s**3)
    hold = np.array([
        hop_s / ANYWHERE, 1.0 / REST_M**2, hop_s / MID_PELVIS, hop_s / PELVIS_HEIGHT,
        hop_s / FOOT_HEIGHT[1], hop_s / FOOT_HEIGHT[0],
    ])  # fmt: skip
    spread = hop_s / np.array([HINGE, CARRIES, LONGER])
    work = np.empty((len(x), KEPT))
    passes, most = 0, 0.0
    while passes < PASSES:
        passes += 1
        most = move_nodes(x, pull, R, bent, stiff, still, hold, spread, lengths, heights, work)
        if np.isnan(most):
            raise EstimationError("l7s_diverged", NOT_FOUND)
        if most < SETTLED_M:
            break
    return x, passes, most


def _level_pelvis(R: Floats) -> Floats:
    """Level pelvis (n, 3, 3) facing the mean direction of the feet."""
    toward = R[:, 1, :2, 2] + R[:, 2, :2, 2]
    toward = toward / np.maximum(np.linalg.norm(toward, axis=1), 1e-9)[:, None]
    level = np.zeros((len(R), 3, 3))
    level[:, 0, 0], level[:, 1, 0] = toward[:, 0], toward[:, 1]
    level[:, 0, 1], level[:, 1, 1] = -toward[:, 1], toward[:, 0]
    level[:, 2, 2] = 1.0
    return level


def _integrate_twice(acc: Floats, dt: float) -> Floats:
    """Displacements (n, 3, 3) from accelerations, each constant up to its sample as in the filter."""
    v = np.cumsum(dt * acc, axis=0)
    return np.asarray(np.cumsum(dt * v - 0.5 * dt * dt * acc, axis=0))


def _interpolate(slow: Floats, nodes: np.ndarray, n: int) -> Floats:
    """Corrections (n, 3, 3) linearly interpolated between the nodes, extrapolated after the last one."""
    hop = int(nodes[1])
    k = np.minimum(np.arange(n) // hop, len(nodes) - 2)
    share = ((np.arange(n) - nodes[k]) / hop)[:, None, None]
    return np.asarray(slow[k] + share * (slow[k + 1] - slow[k]))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _project_all(R, p, lengths):  # type: ignore[no-untyped-def]
    """Project every sample onto the constraints in place; return the sample that failed, or −1.

    The filter's projection with different variances: rotating a foot by 0.1 rad is weighted like shifting a
    body by 1 cm, the pelvis keeps its orientation.
    """
    spread = np.array([1e-4, 1e-4, 1e-4, 1e-8, 1e-8, 1e-8, 1e-4, 1e-4, 1e-4, 1e-2, 1e-2, 1e-2])
    dx, scratch = np.zeros(18), make_scratch()
    for k in range(R.shape[0]):
        for _ in range(PROJECTIONS):
            if not project_places(R[k], p[k], spread, lengths, dx, scratch):
                return k
    return -1
