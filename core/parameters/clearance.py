"""Clearance of heel and toe of the sole above the floor in swing.

Heights are relative to the line between the floor at the two foot-flats of a stride, so that height drift
cancels (docs/science/spatial.md, "Clearance"). Without the shape of the shoe no clearance is reported, and
never that of the sensor instead: toe clearance is one or two centimetres (Winter 1992), less than the
differences between shoes, and a heel position error of 7 cm causes an error of 7 of 23 cm in gaitmap_foot.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from sagittal.core.body.feet import FootTracks
from sagittal.core.frames import Floats, Side

DIP_M: Final = 0.001
"""The toe's least height in mid-swing must lie this far below the heights around it. Our choice: the smoothed
path of a foot moves by less from sample to sample when it passes the floor."""

ClearanceReason = Literal["no_swing_minimum"]


@dataclass(frozen=True, eq=False)
class Spans:
    """Concatenated spans of a signal.

    Parameters
    ----------
    first, last : (spans,) samples, inclusive. start : (spans,) start of each in the concatenation. sample,
        span : (samples,) sample of the signal, and index of its span.
    """

    first: NDArray[np.intp]
    last: NDArray[np.intp]
    start: NDArray[np.intp]
    sample: NDArray[np.intp]
    span: NDArray[np.intp]


def lay_out(first: NDArray[np.intp], last: NDArray[np.intp]) -> Spans:
    """Concatenate the spans between two samples each, inclusive, the first before the last."""
    length = last - first + 1
    start = np.cumsum(length) - length
    span = np.repeat(np.arange(len(first)), length)
    return Spans(first, last, start, np.arange(len(span)) + (first - start)[span], span)


@dataclass(frozen=True, eq=False)
class SoleHeights:
    """Heights (n,) in m of the ankle and of the rear end and tip of the sole."""

    ankle: Floats
    heel: Floats
    toe: Floats


def sole_heights(feet: FootTracks, side: Side) -> SoleHeights | None:
    """Heights of the ends of the sole, None without the shape of the shoe."""
    body = feet.body
    if body.sole_back is None or body.sole_front is None:
        return None
    ahead = feet.sensor_ahead.get(side, 0.0)
    return SoleHeights(
        feet.p[side][:, 2],
        _height(feet, side, ahead - body.sole_back, -body.ankle_height),
        _height(feet, side, ahead + body.sole_front, (body.sole_tip_up or 0.0) - body.ankle_height),
    )


def measure_floor_heights(heights: SoleHeights, spans: Spans, ankle_height: float) -> tuple[Floats, Floats]:
    """Heights (samples,) of heel and tip above the floor between the foot-flats at the ends of spans, m."""
    a, b = heights.ankle[spans.first] - ankle_height, heights.ankle[spans.last] - ankle_height
    slope = (b - a) / (spans.last - spans.first)
    floor = a[spans.span] + slope[spans.span] * (spans.sample - spans.first[spans.span])
    return heights.heel[spans.sample] - floor, heights.toe[spans.sample] - floor


def toe_clearance(h: Floats) -> float | ClearanceReason:
    """Minimum toe clearance in mid-swing, m: the minimum between the maxima after foot-off and before
    contact.

    Parameters
    ----------
    h : (n,) heights of the tip above the floor from foot-off to contact, m.

    Returns
    -------
    "no_swing_minimum" if the tip only rises or only falls, as in some hemiparetic swings: any number would be
    determined by the edge of the window.
    """
    if len(h) < 3:
        return "no_swing_minimum"
    # how deep a sample lies below the highest before it and the highest after it
    depth = np.minimum(np.maximum.accumulate(h), np.maximum.accumulate(h[::-1])[::-1]) - h
    deepest = int(np.argmax(depth))
    return float(h[deepest]) if depth[deepest] >= DIP_M else "no_swing_minimum"


def _height(feet: FootTracks, side: Side, forward: float, up: float) -> Floats:
    """Height (n,) of a point in the sagittal plane of the foot, from the third row of its rotation matrix."""
    w, x, y, z = feet.q[side].T
    along, vertical = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x)
    return np.asarray(feet.p[side][:, 2] + forward * along + up * vertical)
