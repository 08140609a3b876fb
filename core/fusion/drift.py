"""Relative heading in long walks: unobservable with six axes, stabilised by average properties of walking.

Each gyroscope drifts about the vertical independently (a bias walk of 0.003 °/s/√s causes 9° in 5 min), which
appears between two segments as rotation and adduction, later as flexion. Six axes cannot observe it. But in
straight walking the heading of a segment relative to the pelvis, averaged over strides, remains that of the
first straight walking next to standing. Therefore slow changes of the stride-averaged relative heading are
removed. The price, stated in the notice: a true slow change of the mean transverse posture is removed as
well. Short walks are not corrected (docs/science/orientation.md, "Relative drift").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import degrees, radians
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.errors import Notice
from sagittal.core.frames import Bools, Floats, Segment
from sagittal.core.message import Message
from sagittal.core.rotation import about, multiply, yaw
from sagittal.core.signals.calibrated import Calibration
from sagittal.core.signals.held_samples import cut_blocks
from sagittal.core.signals.rest import find_runs, index_window

ALIKE_DIGITS: Final = 6
"""Of drifts in rad that are equal."""


@dataclass(frozen=True)
class DriftParams:
    """Windows of the correction (our choice, tested on simulation with bias walk).

    Parameters
    ----------
    reference_s : duration of straight walking next to standing that defines the mean relative heading; walks
        with no more straight walking than this are not corrected. smooth_s : standard deviation of the
        Gaussian that averages the relative heading: 4 s include at least 6 strides of 1.5 s with at least
        half weight.
    least_s : minimum straight walking within reach; with less the correction is held. tell : reporting
        threshold.
    """

    reference_s: float = 30.0
    smooth_s: float = 4.0
    least_s: float = 3.0
    tell: float = radians(3.0)


def remove_relative_drift(
    q: Mapping[Segment, Floats],
    valid: Mapping[Segment, Bools],
    calibration: Calibration,
    rate_hz: float,
    params: DriftParams,
) -> tuple[dict[Segment, Floats], dict[str, float], list[Notice]]:
    """Rotate each segment about the vertical to keep its stride-averaged heading relative to the reference
    constant.

    Parameters
    ----------
    q : segment → (n, 4) in W. The reference is the pelvis; without it, or if it was lost in between, the mean
        of the segments without data loss.

    Returns
    -------
    Corrected q, the largest correction per segment in rad, notices `heading_rereferenced`.
    """
    corrected = dict(q)
    n = len(next(iter(q.values())))
    straight = np.zeros(n, bool)
    for window in calibration.walking:
        straight[index_window(window, rate_hz)] = True
    gaps = any((~v).any() for v in valid.values())
    if len(q) < 2 or (np.count_nonzero(straight) <= params.reference_s * rate_hz and not gaps):
        return corrected, {}, []
    heading = {s: _find_headings(x) for s, x in q.items()}
    whole = [s for s in q if not _gaps(valid[s], rate_hz)] or list(q)
    steady: list[Segment] = ["pelvis"] if "pelvis" in whole else whole
    reference = np.asarray(np.sum([heading[s] for s in steady], axis=0))
    largest: dict[str, float] = {}
    for segment, x in q.items():
        if steady == [segment]:
            continue
        relative = heading[segment] * np.conj(reference)
        turn = _drift(
            np.asarray(relative), straight & valid[segment], valid[segment], calibration, rate_hz, params
        )
        corrected[segment] = np.empty_like(x)
        for part in cut_blocks(n):
            corrected[segment][part] = multiply(about(2, -turn[part]), x[part])
        largest[segment] = float(np.abs(turn).max())
    notices = []
    if largest and max(largest.values()) > params.tell:
        # two sensors turn apart by the same angle: the first is told of, whatever the last digits are
        worst = max(largest, key=lambda s: round(largest[s], ALIKE_DIGITS))
        message = Message(
            "The heading of {worst} drifted by up to {degrees:.0f}° from the reference and was realigned "
            "to its mean in straight walking. Slow changes of rotational posture during the trial are "
            "removed as well: interpret transverse angles as changes within a stride.",
            worst=worst,
            degrees=degrees(largest[worst]),
        )
        notices.append(Notice("heading_rereferenced", message, sensor=worst, severity="info"))
    return corrected, largest, notices


def _find_headings(q: Floats) -> NDArray[np.complex128]:
    """Headings (n,) of a segment as complex numbers of length 1."""
    headings = np.empty(len(q), np.complex128)
    for part in cut_blocks(len(q)):
        headings[part] = np.exp(1j * yaw(q[part]))
    return headings


def _drift(
    relative: Floats,
    straight: Bools,
    valid: Bools,
    calibration: Calibration,
    rate_hz: float,
    params: DriftParams,
) -> Floats:
    """Drift (n,) in rad of one segment's complex relative heading (n,), zero around standing."""
    zero = index_window(calibration.zero, rate_hz)
    middle = (zero.start + zero.stop) // 2
    turn = np.zeros(len(straight))
    edges = [0, *(b for _, b in _gaps(valid, rate_hz)), len(straight)]
    stretches = [(a, b) for a, b in pairwise(edges) if b > a]
    home = next((r for r in stretches if r[0] <= middle < r[1]), stretches[-1])
    index = home[0] + np.flatnonzero(straight[home[0] : home[1]])
    if not len(index):
        return turn
    near = index[np.argsort(np.abs(index - middle), kind="stable")[: round(params.reference_s * rate_hz)]]
    mean = relative[near].mean()
    for start, end in stretches:
        used = straight[start:end]
        least = params.reference_s if (start, end) == home else params.least_s
        if np.count_nonzero(used) > least * rate_hz:
            turn[start:end] = _smooth(relative[start:end] * np.conj(mean), used, rate_hz, params)
    # inside the reference the mean is the reference: its scatter over strides is not drift
    turn[min(near.min(), zero.start) : max(near.max() + 1, zero.stop)] = 0.0
    return turn


def _gaps(valid: Bools, rate_hz: float) -> list[tuple[int, int]]:
    """Gaps that interrupt the heading: longer than the 0.1 s that are interpolated
    (docs/science/timeline.md, "Rule")."""
    return [r for r in find_runs(~valid) if r[1] - r[0] > 0.1 * rate_hz]


def _smooth(relative: Floats, used: Bools, rate_hz: float, params: DriftParams) -> Floats:
    """Gaussian mean angle (n,) of the used samples; held where there are too few of them."""
    from scipy.ndimage import gaussian_filter1d

    step = max(1, round(0.1 * rate_hz))
    blocks = -(-len(used) // step)
    pad = blocks * step - len(used)
    vectors = np.concatenate((np.where(used, relative, 0.0), np.zeros(pad))).reshape(blocks, step).sum(axis=1)
    weight = np.concatenate((used, np.zeros(pad, bool))).reshape(blocks, step).sum(axis=1) / step
    sigma = params.smooth_s / (step / rate_hz)
    total = gaussian_filter1d(vectors.real, sigma, mode="constant") + 1j * gaussian_filter1d(
        vectors.imag, sigma, mode="constant"
    )
    mass = gaussian_filter1d(weight, sigma, mode="constant") * sigma * np.sqrt(2 * np.pi) * step / rate_hz
    indices = np.flatnonzero(mass >= params.least_s)
    if not len(indices):
        indices = np.array([int(np.argmax(mass))])
    angle = np.unwrap(np.angle(total[indices]))
    return np.interp(np.arange(len(used)), indices * step + 0.5 * step, angle)
