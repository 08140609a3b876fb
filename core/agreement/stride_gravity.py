"""Direction of gravity in a sensor, stride by stride, and the direction in which its segment turns.

A sensor that keeps its place shows gravity in the same direction at the same phase of every stride, whatever
the other sensors do. Two witnesses per stride do not share their errors: gravity at one moment (of a foot its
flat moment, which does not depend on speed) and the mean specific force of the whole stride (which does not
depend on that moment). Equations: docs/science/agreement.md, "Slips without a joint".
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.agreement.params import JointParams
from sagittal.core.agreement.strides import LONGEST_S, USUAL, choose_leg, find_main_axis, find_swings
from sagittal.core.agreement.terms import TiltedSensor, find_bias, start_tilt
from sagittal.core.frames import Floats, Segment
from sagittal.core.rotation import conjugate, find_lengths, rotate
from sagittal.core.signals.recording import SensorSignals, UniformRecording

FLAT_S: Final = 0.12
"""Gravity of a flat foot is averaged so far to either side of its calmest moment, by calm."""
CALM: Final = float(np.radians(20.0))
"""Rate at which a sample counts half in that mean, rad/s."""
SMOOTH_S: Final = 0.06
"""Window of the rate whose minimum is the calmest moment."""


@dataclass(frozen=True, eq=False)
class StrideGravity:
    """How a sensor is tilted in each of k strides, in sensor axes.

    Parameters
    ----------
    at_s : (k,) moments, s. moment : (k, 3) unit vectors of gravity then. whole : (k, 3) unit mean specific
        force of the stride. heading : (k,) direction about gravity of the axis of most rotation, rad, within
        a quarter turn of its typical one.
    """

    at_s: Floats
    moment: Floats
    whole: Floats
    heading: Floats


def cut_strides(recording: UniformRecording) -> dict[Segment, NDArray[np.int64]]:
    """Mid-swings that cut the strides of every sensor of pelvis and legs; sensors without a leg left out."""
    swings: dict[Segment, NDArray[np.int64]] = {}
    found: dict[Segment, NDArray[np.int64]] = {}
    for segment in recording.sensors:
        leg = next((s for s in choose_leg(segment) if s in recording.sensors), None)
        if segment == "chest" or leg is None:
            continue
        if leg not in swings:
            x = recording.sensors[leg]
            swings[leg] = find_swings(x.gyr - find_bias(x, recording.rate_hz), recording.rate_hz)
        found[segment] = swings[leg]
    return found


def measure_stride_gravity(
    segment: Segment, signals: SensorSignals, borders: NDArray[np.int64], rate_hz: float
) -> StrideGravity:
    """Witnesses of every whole stride between two mid-swings.

    Parameters
    ----------
    borders : samples of the mid-swings; strides of unusual length or with lost samples are left out.
    """
    spans = _choose_spans(signals, borders, rate_hz)
    k = len(spans)
    if k == 0:
        return StrideGravity(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    start, norm = start_tilt(signals.acc, signals.valid, rate_hz)
    bias = find_bias(signals, rate_hz)
    motion = TiltedSensor(signals, bias, start, norm, rate_hz, JointParams().attitude)
    q, rate, acc = motion.q, motion.rate, signals.acc
    level = rotate(q, acc)
    first, past = np.array(spans).T
    at, up = first, _sum_spans(level, first, past)
    if segment.startswith("foot"):
        at, up = _find_flats(level, find_lengths(rate), spans, rate_hz)
    moment, whole = rotate(conjugate(q[at]), up), _sum_spans(acc, first, past)
    moment, whole = (x / np.maximum(find_lengths(x), 1e-9)[:, None] for x in (moment, whole))
    pairs = rate[:, (0, 0, 0, 1, 1, 2)] * rate[:, (0, 1, 2, 1, 2, 2)]
    moments = _sum_spans(pairs, first, past)[:, (0, 1, 2, 1, 3, 4, 2, 4, 5)].reshape(k, 3, 3)
    axis = np.linalg.eigh(moments)[1][:, :, -1]
    return StrideGravity(at / rate_hz, moment, whole, _find_headings(axis, whole))


def _sum_spans(x: Floats, first: NDArray[np.int64], past: NDArray[np.int64]) -> Floats:
    """Sums (k, m) of x (n, m) over half-open ranges."""
    total = np.concatenate((np.zeros((1, x.shape[1])), np.cumsum(x, axis=0)))
    return np.asarray(total[past] - total[first])


def _find_flats(
    level: Floats, rate: Floats, spans: list[tuple[int, int]], rate_hz: float
) -> tuple[NDArray[np.int64], Floats]:
    """Calmest sample (k,) of each stride, and the level specific force (k, 3) around it, weighted by calm."""
    speed = _smooth(rate, max(1, round(SMOOTH_S * rate_hz)))
    reach = round(FLAT_S * rate_hz)
    at, up = np.zeros(len(spans), np.int64), np.zeros((len(spans), 3))
    for i, (a, b) in enumerate(spans):
        at[i] = a + int(np.argmin(speed[a:b]))
        near = slice(max(a, at[i] - reach), min(b, at[i] + reach + 1))
        up[i] = 1.0 / (1.0 + (speed[near] / CALM) ** 2) @ level[near]
    return at, up


def find_typical(directions: Floats) -> Floats:
    """Middle direction (3,) of unit vectors (k, 3)."""
    middle = np.median(directions, axis=0)
    return np.asarray(middle / max(float(np.linalg.norm(middle)), 1e-9))


def _choose_spans(
    signals: SensorSignals, borders: NDArray[np.int64], rate_hz: float
) -> list[tuple[int, int]]:
    if len(borders) < 2:
        return []
    usual = float(np.median(np.diff(borders)))
    lost = np.concatenate(([0], np.cumsum(~signals.valid)))
    return [
        (int(a), int(b))
        for a, b in pairwise(borders)
        if USUAL[0] * usual <= b - a <= min(USUAL[1] * usual, LONGEST_S * rate_hz) and lost[b + 1] == lost[a]
    ]


def _smooth(x: Floats, width: int) -> Floats:
    return np.asarray(np.convolve(x, np.full(width, 1.0 / width), "same"))


def _find_headings(axes: Floats, whole: Floats) -> Floats:
    """Direction (k,) about gravity of axes (k, 3) without sign, rad."""
    up = find_typical(whole)
    typical = find_main_axis(axes)
    ahead = typical - float(typical @ up) * up
    ahead /= max(float(np.linalg.norm(ahead)), 1e-9)
    signed = axes * np.where(axes @ typical < 0.0, -1.0, 1.0)[:, None]
    return np.asarray(np.arctan2(signed @ np.cross(up, ahead), signed @ ahead))
