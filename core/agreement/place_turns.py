"""Rotation of the joint positions in the axes of an adjacent sensor, and detection of lasting changes (slip).

Equations: docs/science/agreement.md, "Slipped sensors".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numba
import numpy as np

from sagittal.core.agreement.lags import MAD
from sagittal.core.agreement.params import SlipParams
from sagittal.core.agreement.windows import JointWindows
from sagittal.core.frames import Bools, Floats, Segment

INDEPENDENT: Final = 5.0
"""More windows side by side than this do not make a median surer: gait changes between them too."""

DOUBT: Final = 2.0
"""Another sensor's turn counts beyond so many times its own scatter."""

FINEST_S: Final = 0.5
LIKELY: Final = 0.5
"""Moments at which even the means differ by less than this share of the smallest slip are passed over."""


@dataclass(frozen=True, eq=False)
class PlaceTurns:
    """Rotation of the joint positions about the medio-lateral axis, window by window.

    Parameters
    ----------
    t_s, turn : (m,) s, rad. places : (m, joints, 3) perpendicular to the axis, rotated back, m.
    step_s : between windows.
    """

    t_s: Floats
    turn: Floats
    places: Floats
    step_s: float


@dataclass(frozen=True)
class PlaceStep:
    """A lasting rotation: time s, angle rad, ratio to its scatter, and the scatter, rad."""

    at_s: float
    size: float
    z: float
    sd: float


def find_turns(
    joints: Sequence[JointWindows], axes: Mapping[Segment, Floats], params: SlipParams
) -> dict[Segment, PlaceTurns]:
    """Rotation of the joint positions around every sensor.

    Parameters
    ----------
    joints : with usable windows (`is_moving`). axes : sensor → main rotation axis (3,).
    """
    turns = {s: _find_place_turns(s, joints, axis, params) for s, axis in axes.items()}
    return {s: x for s, x in turns.items() if x is not None}


def judge_turns(
    turns: Mapping[Segment, PlaceTurns], half: float, params: SlipParams, since_s: float = -np.inf
) -> dict[Segment, PlaceStep]:
    """Sensor → time of a lasting rotation of its joint positions without one of the other sensors.

    Parameters
    ----------
    half : half a window width, s. since_s : earlier moments are ignored.
    """
    steps: dict[Segment, PlaceStep] = {}
    for segment, place_turns in turns.items():
        step = _find_best_step(place_turns, half, params, since_s)
        if step is None or not _is_alone(segment, step, turns, half, params):
            continue
        if _measure_misfit(place_turns, step, half) < params.misfit:
            steps[segment] = step
    return steps


def _find_place_turns(
    segment: Segment,
    joints: Sequence[JointWindows],
    axis: Floats,
    params: SlipParams,
) -> PlaceTurns | None:
    """Rotations of the joint positions from their typical ones, for windows usable at all its joints."""
    own = [w for w in joints if segment in (w.first, w.second)]
    # one joint alone says too little, except at a foot, which has no other
    if not own or (len(own) < 2 and not segment.startswith("foot")):
        return None
    t = own[0].t_s
    for w in own[1:]:
        t = np.intersect1d(t, w.t_s, assume_unique=True)
    if len(t) < 2 * params.least_windows:
        return None
    V = np.stack([w.place_in(segment)[np.isin(w.t_s, t, assume_unique=True)] for w in own], axis=1)
    turn, back = turn_places(V, axis)
    return PlaceTurns(t, np.unwrap(turn), back, float(np.median(np.diff(t))))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def turn_places(V, axis):  # type: ignore[no-untyped-def]
    """Rotations (m,) about an axis (3,) of positions V (m, joints, 3) from their median, and the positions
    perpendicular to the axis rotated back by them.
    """
    m, joints = V.shape[:2]
    x, y, z = axis
    perpendicular, back = np.empty(V.shape), np.empty(V.shape)
    for k in range(m):
        for j in range(joints):
            along = V[k, j, 0] * x + V[k, j, 1] * y + V[k, j, 2] * z
            for c in range(3):
                perpendicular[k, j, c] = back[k, j, c] = V[k, j, c] - along * axis[c]
    turn, typical = np.zeros(m), np.empty((joints, 3))
    for _ in range(2):
        for j in range(joints):
            for c in range(3):
                typical[j, c] = np.median(back[:, j, c])
        for k in range(m):
            sine = cosine = 0.0
            for j in range(joints):
                a, b, d = typical[j]
                p, q, r = perpendicular[k, j]
                sine += x * (b * r - d * q) + y * (d * p - a * r) + z * (a * q - b * p)
                cosine += a * p + b * q + d * r
            turn[k] = np.arctan2(sine, cosine)
            c0, s0 = np.cos(turn[k]), np.sin(turn[k])
            for j in range(joints):
                p, q, r = perpendicular[k, j]
                back[k, j, 0] = c0 * p - s0 * (y * r - z * q)
                back[k, j, 1] = c0 * q - s0 * (z * p - x * r)
                back[k, j, 2] = c0 * r - s0 * (x * q - y * p)
    return turn, back


def measure_step(
    turns: PlaceTurns, at_s: float, half: float, floor: float, reach: float = np.inf
) -> tuple[float, float] | None:
    """Rotation between windows entirely before and entirely after a moment, and its standard deviation."""
    size, sd = _compare_sides(turns.t_s, turns.turn, turns.step_s, at_s, half, floor, reach)
    return None if np.isnan(size) else (size, sd)


def is_lasting(turns: PlaceTurns, at_s: float, turn_rad: float, half: float, params: SlipParams) -> bool:
    """Whether a rotation persists; also true if no earlier window is left for comparison."""
    measured = measure_step(turns, at_s, half, params.floor_rad)
    return measured is None or measured[0] / turn_rad >= params.lasting


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _compare_sides(t_s, turn, step_s, at_s, half, floor, reach):  # type: ignore[no-untyped-def]
    """Difference of the medians before and after, and its spread; NaN if either has no window."""
    earlier = turn[(t_s <= at_s - half) & (t_s >= at_s - reach)]
    later = turn[(t_s >= at_s + half) & (t_s <= at_s + reach)]
    if len(earlier) == 0 or len(later) == 0:
        return np.nan, np.nan
    spread, inverse = floor, 0.0
    for x in (earlier, later):
        spread = max(spread, MAD * np.median(np.abs(x - np.median(x))))
        inverse += 1.0 / min(max(len(x) * step_s / (2.0 * half), 1.0), INDEPENDENT)
    return np.median(later) - np.median(earlier), spread * np.sqrt(inverse)


def _find_best_step(turns: PlaceTurns, half: float, params: SlipParams, since_s: float) -> PlaceStep | None:
    """The moment with the clearest lasting change of the joint positions; None below the limits."""
    best, most = None, 0.0
    least = params.least_windows
    first, last = max(turns.t_s[least - 1] + half, since_s), turns.t_s[-least] - half
    moments = np.arange(first, last + 0.01, max(FINEST_S, 0.5 * turns.step_s))
    for moment in moments[_is_likely(turns, moments, half, LIKELY * params.least_rad)]:
        measured = measure_step(turns, float(moment), half, params.floor_rad, params.near_s)
        if measured is None or not is_lasting(turns, float(moment), measured[0], half, params):
            continue
        size, sd = measured
        z = abs(size) / sd
        if z * abs(size) > most:
            best, most = PlaceStep(float(moment), size, z, sd), z * abs(size)
    if best is None or abs(best.size) <= params.least_rad or best.z <= params.z:
        return None
    return replace(best, at_s=_find_moment(turns, best, half, moments, params))


def _find_moment(
    turns: PlaceTurns, step: PlaceStep, half: float, moments: Floats, params: SlipParams
) -> float:
    """Time of the rotation: windows that contain it show part of it, which makes a ramp of their width."""
    best, least = step.at_s, np.inf
    near = np.abs(turns.t_s - step.at_s) <= params.near_s
    t, x = turns.t_s[near], turns.turn[near]
    for moment in moments[np.abs(moments - step.at_s) <= 0.5 * params.near_s]:
        earlier, later = x[t <= moment - half], x[t >= moment + half]
        if not len(earlier) or not len(later):
            continue
        share = np.clip((t - moment + half) / (2.0 * half), 0.0, 1.0)
        ramp = np.median(earlier) + share * (np.median(later) - np.median(earlier))
        left = float(np.abs(x - ramp).sum())
        if left < least:
            best, least = float(moment), left
    return best


def _is_likely(turns: PlaceTurns, moments: Floats, half: float, least: float) -> Bools:
    """Moments with a difference of the mean rotation before and after above a minimum: a fast
    preselection.
    """
    total = np.concatenate(([0.0], np.cumsum(turns.turn)))
    a = np.searchsorted(turns.t_s, moments - half + 1e-9)
    b = np.searchsorted(turns.t_s, moments + half - 1e-9)
    n = len(turns.turn)
    mean_after = (total[n] - total[b]) / np.maximum(n - b, 1)
    return np.asarray(np.abs(mean_after - total[a] / np.maximum(a, 1)) > least, np.bool_)


def _is_alone(
    segment: Segment, step: PlaceStep, turns: Mapping[Segment, PlaceTurns], half: float, params: SlipParams
) -> bool:
    """Whether the other sensors remain stable at that moment; a change of gait rotates several."""
    sizes = []
    for neighbour, place_turns in turns.items():
        if neighbour == segment:
            continue
        measured = measure_step(place_turns, step.at_s, half, params.floor_rad, params.near_s)
        if measured is not None:
            sizes.append(max(0.0, abs(measured[0]) - DOUBT * measured[1]))
    return len(sizes) > 1 and max(sizes) < params.alone * abs(step.size)


def _measure_misfit(turns: PlaceTurns, step: PlaceStep, half: float) -> float:
    """Relative change of the joint positions that is not explained by the rotation."""
    places_before = np.median(turns.places[turns.t_s <= step.at_s - half], axis=0)
    places_after = np.median(turns.places[turns.t_s >= step.at_s + half], axis=0)
    size = 0.5 * float(np.linalg.norm(places_before) + np.linalg.norm(places_after))
    return float(np.linalg.norm(places_before - places_after) / max(size, 1e-9))
