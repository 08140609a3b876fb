"""Check of the declared sampling rate: the mean specific force of a foot over a stride equals gravity.

A foot that rests before and after a stride has, over the stride, a mean specific force of length g in a frame
that does not rotate. A rate that is wrong by a factor k rotates that frame k times too far. Both feet must
agree. A wrong gyroscope scale has the same effect, so the notice asks for a check and nothing is rescaled
(docs/science/consistency.md, "Sampling rate").
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import hypot, sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.agreement.stride_gravity import cut_strides, measure_stride_gravity
from sagittal.core.agreement.terms import find_bias
from sagittal.core.consistency.doubt import RATE, Doubt
from sagittal.core.errors import Notice
from sagittal.core.frames import FOOT, GRAVITY
from sagittal.core.message import Message
from sagittal.core.rotation import exp, find_lengths, multiply, rotate
from sagittal.core.signals.recording import SensorSignals, UniformRecording
from sagittal.core.signals.rest import measure_quietness

LEAST: Final = 0.025
"""Smallest error of a rate that is reported. Clean recordings on which both feet agree reach 0.011."""
AGREE: Final = 0.020
"""Largest difference of both feet; beyond, one of them says nothing true."""
SCATTER: Final = 3.0
"""Least ratio of the error to its standard deviation."""
LEAST_STRIDES: Final = 10
MOST_STRIDES: Final = 40
STRIDE_S: Final = (0.6, 2.6)
"""Time between two rests that one stride takes."""
LEAST_SLOPE: Final = 0.15
"""Feet whose length of gravity changes by less with the rate hardly pitch: they cannot judge."""
TRIED: Final = (0.95, 1.0, 1.05)
OWN: Final = 0.004
PER_EXCESS: Final = 0.25
NO_REST: Final = 0.012
"""Standard deviation beside the scatter of strides: always, per share by which the length of gravity at rest
is off, and where a foot never rested (measured on feet whose rate is right)."""


@dataclass(frozen=True)
class RateEvidence:
    """True over declared turning of one foot, its standard deviation, and the strides it was read from."""

    factor: float
    sd: float
    strides: int


def measure_rate(foot: SensorSignals, flats: NDArray[np.int64], rate_hz: float) -> RateEvidence | None:
    """Factor of the rate at which gravity has its length over each stride of one foot; None if undetermined.

    Parameters
    ----------
    flats : samples at which the foot is flat, one a stride.
    """
    spans = [
        (a, b)
        for a, b in pairwise(flats.tolist())
        if STRIDE_S[0] < (b - a) / rate_hz < STRIDE_S[1] and foot.valid[a : b + 1].all()
    ]
    if len(spans) < LEAST_STRIDES:
        return None
    spans = [spans[i] for i in np.unique(np.linspace(0, len(spans) - 1, MOST_STRIDES).astype(int))]
    quiet = measure_quietness(foot, rate_hz).quiet
    rested = bool(quiet.any())
    gravity = float(np.median(find_lengths(foot.acc[quiet if rested else flats])))
    excess = _measure_lengths(foot, spans, rate_hz) / gravity - 1.0
    middle = np.median(excess, axis=0)
    slope = float(middle[2] - middle[0]) / (TRIED[2] - TRIED[0])
    if abs(slope) < LEAST_SLOPE:
        return None
    spread = 1.4826 * float(np.median(np.abs(excess[:, 1] - middle[1])))
    scatter = 1.25 * spread / abs(slope) / sqrt(len(excess))
    off = OWN + PER_EXCESS * abs(gravity / GRAVITY - 1.0) + (0.0 if rested else NO_REST)
    return RateEvidence(1.0 - float(middle[1]) / slope, hypot(scatter, off), len(excess))


def judge_rate(recording: UniformRecording, *, treadmill: bool) -> Doubt | None:
    """A doubt where both feet contradict the rate; never on a treadmill, where clean feet do so as well."""
    borders = cut_strides(recording)
    if treadmill or not all(foot in borders for foot in FOOT.values()):
        return None
    rates = []
    for foot in FOOT.values():
        signals, rate_hz = recording.sensors[foot], recording.rate_hz
        strides = measure_stride_gravity(foot, signals, borders[foot], rate_hz)
        evidence = measure_rate(signals, np.round(strides.at_s * rate_hz).astype(np.int64), rate_hz)
        if evidence is None:
            return None
        rates.append(evidence)
    left, right = rates
    if abs(left.factor - right.factor) > AGREE:
        return None
    weights = [1.0 / x.sd**2 for x in rates]
    factor = sum(w * x.factor for w, x in zip(weights, rates, strict=True)) / sum(weights)
    sd = 1.0 / sqrt(sum(weights))
    if abs(factor - 1.0) < max(LEAST, SCATTER * sd):
        return None
    return Doubt(
        Notice(
            RATE,
            Message(
                "Gravity over the strides of both feet indicates a sampling rate of {rate:.1f} Hz, not "
                "{declared:.1f} Hz ({change:+.1f} ± {sd:.1f} %). Times, lengths and speeds may be "
                "wrong by at "
                "least as much. Check the declared rate; a wrong gyroscope scale has the same effect.",
                rate=recording.rate_hz / factor,
                declared=recording.rate_hz,
                change=100 * (1 / factor - 1),
                sd=200 * sd,
            ),
        ),
        "none",
    )


def _measure_lengths(
    foot: SensorSignals, spans: list[tuple[int, int]], rate_hz: float
) -> NDArray[np.float64]:
    """Length (k, 3) of the mean specific force of k strides at every tried factor of the rate."""
    first = np.array([a for a, _ in spans])
    length = np.array([b - a for a, b in spans])
    n = int(length.max()) + 1
    index = np.minimum(first[:, None] + np.arange(n), len(foot.acc) - 1)
    rate = foot.gyr - find_bias(foot, rate_hz)
    turn = 0.5 * (rate[index[:, :-1]] + rate[index[:, 1:]]) / rate_hz
    weight = (np.arange(n) <= length[:, None]).astype(np.float64)
    weight[:, 0] = weight[np.arange(len(length)), length] = 0.5
    q = np.zeros((len(spans), len(TRIED), 4))
    q[..., 0] = 1.0
    total = np.zeros((len(spans), len(TRIED), 3))
    factors = np.array(TRIED)[None, :, None]
    for i in range(n):
        force = np.broadcast_to(foot.acc[index[:, i]][:, None], total.shape)
        total += rotate(q, force) * weight[:, i, None, None]
        if i < n - 1:
            q = multiply(q, exp(turn[:, i][:, None] * factors))
    return find_lengths(total / length[:, None, None])
