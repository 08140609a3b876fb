"""Lags across joints → clock offsets and clock drifts of sensors.

Joints observe only differences between clocks: the clock of the majority is the reference. The result is the
smallest set of sensors, or whole distal chains, that explains the lags of all joints
(docs/science/agreement.md, "Late sensors").
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from sagittal.core.agreement.joints import CHAINS, LEG_JOINTS
from sagittal.core.agreement.params import LagParams
from sagittal.core.agreement.windows import JointWindows
from sagittal.core.frames import Floats, Segment

MAD: Final = 1.4826
"""Standard deviation of a normal spread whose median absolute deviation is 1."""

MEDIAN_SD: Final = 1.25
"""Standard error of a median over that of a mean."""

LEAST_SPREAD_S: Final = 0.002
"""No joint is believed to be steadier than this."""

LEAST_DRIFT_SPREAD_S: Final = 0.0015

MOST_LATE: Final = 3
"""Sensors that may be named; with more, no majority is left."""

GROUP_COST: Final = 1.5
"""A group of sensors must explain so much more than one: that several share one wrong clock is rarer."""

DRIFT_WINDOWS: Final = 6

FAR: Final = 0.25
"""Pairs of windows closer than this share of the take say nothing about its slope."""


@dataclass(frozen=True)
class SensorLag:
    """Sensors with a common clock offset.

    Parameters
    ----------
    sensors : one, or all distal to one joint. lag_s : positive = late, mean over the recording. sd_s : of it,
        including the apparent lag caused by soft tissue and joint. told : the limits for a report are
        exceeded. sure : a single sensor, with evidence from more than a hip or one pair of sensors; required
        for correction.
    """

    sensors: tuple[Segment, ...]
    lag_s: float
    sd_s: float
    told: bool
    sure: bool


@dataclass(frozen=True)
class SensorDrift:
    """A clock that runs slow (positive) or fast: change of the lag over the recording.

    Parameters
    ----------
    change_s, sd_s : from `from_s` to `until_s`.
    """

    sensor: Segment
    change_s: float
    sd_s: float
    from_s: float
    until_s: float


def find_sensor_lags(joints: Sequence[JointWindows], params: LagParams) -> tuple[SensorLag, ...]:
    """The smallest set of sensors whose lags explain those of the joints.

    Forward selection by weighted least squares: each sensor or group must reduce the sum by more than z².
    """
    use = _speaking(joints, params)
    if not use:
        return ()
    lag, sd = np.array([_median_lag(w, params) for w in use]).T
    y = lag / sd
    chosen: list[tuple[Segment, ...]] = []
    while sum(map(len, chosen)) < MOST_LATE:
        addition = _best_addition(use, sd, y, chosen, params)
        if addition is None:
            break
        chosen.append(addition)
    if not chosen:
        return ()
    A = np.column_stack([_column(use, sd, c) for c in chosen])
    x = np.linalg.lstsq(A, y, rcond=None)[0]
    spread = np.sqrt(np.diag(np.linalg.inv(A.T @ A)))
    out = []
    for k, sensors in enumerate(chosen):
        speaking = [w for w, a in zip(use, A[:, k], strict=True) if a]
        hip = all(LEG_JOINTS[w.first, w.second] == "hip" for w in speaking)
        sure = (
            len(sensors) == 1
            and len(speaking) + _further(use, speaking) > 1
            and (not hip or len(speaking) > 1)
        )
        least = params.least_s if sure else params.least_group_s
        out.append(SensorLag(sensors, float(x[k]), float(spread[k]), bool(abs(x[k]) > least), sure))
    return tuple(out)


def find_drifts(joints: Sequence[JointWindows], params: LagParams) -> tuple[SensorDrift, ...]:
    """Single sensors whose lag changes over the recording; Theil-Sen slopes of the joint lags.

    The apparent lag caused by soft tissue and joint is constant and cancels.
    """
    use = [w for w in _speaking(joints, params) if len(w.t_s) >= DRIFT_WINDOWS]
    if not use:
        return ()
    start, end = min(w.t_s[0] for w in use), max(w.t_s[-1] for w in use)
    slope, slope_sd = np.array([_slope(w) for w in use]).T
    sd: Floats = slope_sd * (end - start)
    left = slope * (end - start) / sd
    out: list[SensorDrift] = []
    for _ in range(MOST_LATE):
        best = None
        for sensor in sorted({s for w in use for s in (w.first, w.second)} - {d.sensor for d in out}):
            column = _column(use, sd, (sensor,))
            weight = float(column @ column)
            change = float(column @ left) / weight
            gain = change**2 * weight
            if gain > params.drift_z**2 and abs(change) > params.drift_s and (best is None or gain > best[0]):
                best = (gain, SensorDrift(sensor, change, weight**-0.5, float(start), float(end)), column)
        if best is None:
            break
        out.append(best[1])
        left = left - best[2] * best[1].change_s
    return tuple(out)


def list_judged(joints: Sequence[JointWindows], params: LagParams) -> frozenset[Segment]:
    """Sensors whose clock can be compared with another one at a joint."""
    return frozenset(s for w in _speaking(joints, params) for s in (w.first, w.second))


def _speaking(joints: Sequence[JointWindows], params: LagParams) -> list[JointWindows]:
    """Joints whose windows are consistent enough to estimate a lag."""
    usable = [w.choose(w.certain & (w.residual < params.worst_residual)) for w in joints]
    return [w for w in usable if len(w.t_s) >= params.least_windows]


def _further(use: Sequence[JointWindows], speaking: Sequence[JointWindows]) -> int:
    """Number of further joints connected to these, which can decide which of two sensors is the late one."""
    ends = {s for w in speaking for s in (w.first, w.second)}
    return sum(w not in speaking and bool(ends & {w.first, w.second}) for w in use)


def _median_lag(w: JointWindows, params: LagParams) -> tuple[float, float]:
    """Lag of a joint and its standard deviation, corrected for overlapping windows."""
    bias: Mapping[str, float] = {"hip": params.hip_sd_s, "knee": params.knee_sd_s, "ankle": params.ankle_sd_s}
    middle = float(np.median(w.lag_s))
    spread = np.hypot(MAD * float(np.median(np.abs(w.lag_s - middle))), LEAST_SPREAD_S)
    independent = max(1.0, len(w.lag_s) * w.step_s / w.width_s)
    return middle, float(
        np.hypot(MEDIAN_SD * spread / np.sqrt(independent), bias[LEG_JOINTS[w.first, w.second]])
    )


def _column(use: Sequence[JointWindows], sd: Floats, sensors: tuple[Segment, ...]) -> Floats:
    """Effect of one second of lag of these sensors on the joints, in units of their spreads (joints,)."""
    return np.array([float(w.second in sensors) - float(w.first in sensors) for w in use]) / sd


def _best_addition(
    use: Sequence[JointWindows],
    sd: Floats,
    y: Floats,
    chosen: Sequence[tuple[Segment, ...]],
    params: LagParams,
) -> tuple[Segment, ...] | None:
    """The sensor or group that explains most of the residual, None if none explains enough."""
    segments = sorted({s for w in use for s in (w.first, w.second)})
    linked = {frozenset((w.first, w.second)) for w in use}
    groups = [g for g in CHAINS if all(frozenset(e) in linked for e in pairwise(g))]
    explained = {s for c in chosen for s in c}
    residual = _left_over([_column(use, sd, c) for c in chosen], y)
    best, most = None, params.z**2
    if residual <= most:
        return None
    for option in (*((s,) for s in segments), *groups):
        column = _column(use, sd, option)
        if explained & set(option) or not column.any():
            continue
        columns = [*(_column(use, sd, c) for c in chosen), column]
        if np.linalg.matrix_rank(np.column_stack(columns)) < len(columns):
            continue
        worth = (residual - _left_over(columns, y)) / (1.0 if len(option) == 1 else GROUP_COST)
        if worth > most:
            best, most = option, worth
    return best


def _left_over(columns: Sequence[Floats], y: Floats) -> float:
    if not columns:
        return float(y @ y)
    A = np.column_stack(columns)
    return float(np.sum((y - A @ np.linalg.lstsq(A, y, rcond=None)[0]) ** 2))


def _slope(w: JointWindows) -> tuple[float, float]:
    """Median slope of a joint's lag and its standard deviation, s/s."""
    apart = w.t_s[None, :] - w.t_s[:, None]
    i, j = np.nonzero(apart > FAR * (w.t_s[-1] - w.t_s[0]))
    slope = float(np.median((w.lag_s[j] - w.lag_s[i]) / apart[i, j]))
    remainder = w.lag_s - slope * w.t_s
    spread = max(MAD * float(np.median(np.abs(remainder - np.median(remainder)))), LEAST_DRIFT_SPREAD_S)
    overlap = w.width_s / w.step_s
    reach = np.sqrt(max(float(np.sum((w.t_s - w.t_s.mean()) ** 2)), 1e-9))
    return slope, float(np.sqrt(overlap) * MEDIAN_SD * spread / reach)
