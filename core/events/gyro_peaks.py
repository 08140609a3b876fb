"""Contacts from the sagittal angular rate of foot or shank: one detector with configurable rules.

Every swing is a peak of the rate (forward positive). After it the segment slows down, its rate crosses zero
and has a negative peak: one of the two is the initial contact. Before it, during heel rise, the rate has its
deepest minimum: the terminal contact. The published detectors differ in segment, feature, waiting times and
threshold. Their full rules are not openly available; the presets combine the published parts
(docs/science/events.md, "Presets") and are called reconstructions: their results are not those of the papers.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import pairwise
from math import radians
from types import MappingProxyType
from typing import Final, Literal

import numpy as np

from sagittal.core.errors import Notice, SignalError
from sagittal.core.events.result import GaitEvent, GaitEvents
from sagittal.core.frames import FOOT, SHANK, SIDES, Bools, Floats, Oriented, Segment, Side
from sagittal.core.message import Message
from sagittal.core.plurals import plural
from sagittal.core.rotation import conjugate, log, multiply
from sagittal.core.signals.filtering import low_pass
from sagittal.core.signals.held_samples import compare_neighbours
from sagittal.core.signals.peaks import find_peaks


@dataclass(frozen=True)
class GyroPeakParams:
    """Rules of the detector.

    Parameters
    ----------
    name : source of its events.
    segment : segment whose rate is used.
    contact : "zero_cross" = the rate passes zero after the swing, "neg_peak" = the deepest minimum within
        `contact_s` after that.
    leaving : "before_swing" = the last minimum before the swing, "deepest" = the deepest between contact and
        swing; both after the waiting time and at least `leaving_rad_s` deep.
    swing_rad_s : minimum peak of a swing. refractory_s : minimum time between two swings.
    unclear : fraction of the threshold, and of the swings: with this fraction of peaks between the lower
        limit and the threshold the swings of a foot are unclear, and none is reported. Our choice: in the
        severe simulated shuffle half of the swings of the foot exceed the threshold. apart_s : minimum
        distance of two swings for this check.
    wait_s : minimum time from a contact to the following terminal contact.
    low_pass_hz : zero-phase low-pass of the rate, None = unfiltered.
    longest_s : from swing peak to contact, and from terminal contact to swing peak. min_rate_hz : as for the
        foot-pitch rule.
    """

    name: str = "gyro_peaks"
    segment: Literal["foot", "shank"] = "shank"
    contact: Literal["zero_cross", "neg_peak"] = "neg_peak"
    leaving: Literal["before_swing", "deepest"] = "before_swing"
    swing_rad_s: float = radians(100.0)
    refractory_s: float = 0.35
    unclear: tuple[float, float] = (0.6, 0.2)
    apart_s: float = 0.5
    contact_s: float = 0.15
    wait_s: float = 0.1
    leaving_rad_s: float = radians(20.0)
    low_pass_hz: float | None = None
    longest_s: float = 0.6
    min_rate_hz: float = 40.0


@dataclass(frozen=True)
class GyroPeakPresets:
    """Reconstructions of published detectors (docs/science/events.md, "Presets"), by the first author's name.

    Parameters
    ----------
    gouwanda : shank, zero crossing with heuristics, TC ≥ 100 ms after IC, 350 ms refractory.
    catalfamo : shank, IC = minimum after the swing peak, TC = later minimum below a threshold.
    maqbool : shank, swing peak, IC = first negative minimum, 300 ms wait, TC = next minimum.
    mariani : foot pitch rate around mid-swing.
    perez_ibarra : foot, amplitude threshold between stance and swing.
    """

    gouwanda: GyroPeakParams = GyroPeakParams(
        "gouwanda", "shank", "zero_cross", refractory_s=0.35, wait_s=0.1
    )
    catalfamo: GyroPeakParams = GyroPeakParams("catalfamo", "shank", "neg_peak", wait_s=0.3)
    maqbool: GyroPeakParams = GyroPeakParams(
        "maqbool", "shank", "neg_peak", "deepest", wait_s=0.3, low_pass_hz=10.0
    )
    mariani: GyroPeakParams = GyroPeakParams("mariani", "foot", "zero_cross")
    perez_ibarra: GyroPeakParams = GyroPeakParams(
        "perez_ibarra", "foot", "neg_peak", swing_rad_s=radians(150.0)
    )

    @property
    def by_name(self) -> Mapping[str, GyroPeakParams]:
        """Name → rules of the detector, in the order above."""
        return MappingProxyType({f.name: getattr(self, f.name) for f in fields(self)})


RECONSTRUCTION: Final = "reconstruction"
"""What a preset is called wherever its name is shown."""

LIMB: Final[Mapping[str, Mapping[Side, Segment]]] = MappingProxyType({"foot": FOOT, "shank": SHANK})


def gyro_peak_events(take: Oriented, rate_hz: float, params: GyroPeakParams | None = None) -> GaitEvents:
    """Contacts of every side with a sensor on the segment.

    Parameters
    ----------
    take : orientations of the segments, ISB axes.

    Returns
    -------
    Events in chronological order; `detected_s` is the time of detection. Notices: `segment_missing`,
    `no_swing`, `swing_unclear`.

    Raises
    ------
    SignalError : `sample_rate_too_low`.
    """
    params = params or GyroPeakParams()
    if rate_hz < params.min_rate_hz:
        raise SignalError(
            "sample_rate_too_low",
            Message(
                "Gait events need at least {min_rate_hz:g} Hz, the recording has {rate_hz:g} Hz. "
                "Record at a higher rate.",
                min_rate_hz=params.min_rate_hz,
                rate_hz=rate_hz,
            ),
        )
    events: list[GaitEvent] = []
    notices: list[Notice] = []
    for side in SIDES:
        segment = LIMB[params.segment][side]
        if segment not in take.q or not take.valid[segment].any():
            message = Message(
                "No sensor on the {side} {segment}: {name} cannot detect its contacts.",
                side=side,
                segment=params.segment,
                name=params.name,
            )
            notices.append(Notice("segment_missing", message, segment))
            continue
        rate = sagittal_rate(take.q[segment], rate_hz)
        if params.low_pass_hz is not None:
            rate = low_pass(rate, params.low_pass_hz, rate_hz)
        unclear = _unclear(rate[take.valid[segment]], rate_hz, params)
        if unclear:
            notices.append(_say_unclear(side, segment, unclear, params))
            continue
        contacts = _events(side, rate, take.valid[segment], take.t_s, rate_hz, params)
        events += contacts
        if not contacts:
            top = float(np.degrees(rate[take.valid[segment]].max(initial=0.0)))
            notices.append(
                Notice(
                    "no_swing",
                    Message(
                        "The {side} {segment} never swung faster than {swing_rad_s:.0f}°/s (fastest was "
                        "{top:.0f}°/s), so {name} found no contacts on it.",
                        side=side,
                        segment=params.segment,
                        swing_rad_s=np.degrees(params.swing_rad_s),
                        top=top,
                        name=params.name,
                    ),
                    segment,
                )
            )
    events.sort(key=lambda e: (e.time_s, e.side, e.kind))
    return GaitEvents(tuple(events), tuple(notices))


def sagittal_rate(q: Floats, rate_hz: float) -> Floats:
    """Angular rate (n,) in rad/s about the segment's medio-lateral axis: the distal end forward positive."""
    step = compare_neighbours(q, lambda a, b: log(multiply(conjugate(a), b))[:, 2] * rate_hz)
    return np.append(step, step[-1:] if len(step) else 0.0)


def _events(
    side: Side, rate: Floats, valid: Bools, t_s: Floats, rate_hz: float, params: GyroPeakParams
) -> list[GaitEvent]:
    """Contacts of one segment, swing by swing."""
    distance = max(1.0, params.refractory_s * rate_hz)
    swings = find_peaks(np.where(valid, rate, 0.0), height=params.swing_rad_s, distance=distance)
    reach = round(params.longest_s * rate_hz)
    step = 1.0 / rate_hz
    course, begin_s = _Course(rate, valid), float(t_s[0])
    events: list[GaitEvent] = []
    landed = 0
    ends = [*swings.tolist(), len(rate)]
    for swing, following in pairwise(ends):
        # waiting after a contact matters only when that contact is near
        start = max(landed + round(params.wait_s * rate_hz) if landed else 0, swing - reach)
        leaving = _leaving(course, start, swing, params)
        if leaving is not None and course.is_valid(leaving, swing):
            # the minimum is believed when the swing shows that the foot has left
            time = float(t_s[leaving] + _vertex(rate, leaving) * step)
            events.append(GaitEvent(time, side, "tc", params.name, float(t_s[swing])))
        contact = _contact(course, swing, min(following, swing + reach), rate_hz, params)
        if contact is not None and course.is_valid(swing, contact[1]):
            sample, known_at = contact
            events.append(GaitEvent(begin_s + sample * step, side, "ic", params.name, float(t_s[known_at])))
            landed = known_at
    return events


class _Course:
    """A rate (n,) with features precomputed for all swings.

    Parameters
    ----------
    valid : (n,) sensor data available.
    """

    def __init__(self, rate: Floats, valid: Bools) -> None:
        self.rate = rate
        self._lows: list[int] = _minima(rate).tolist()
        self._below: list[int] = np.flatnonzero(rate <= 0.0).tolist()
        self._lost: list[int] = np.flatnonzero(~valid).tolist()

    def find_lows(self, start: int, end: int) -> list[int]:
        """Local minima strictly between two samples."""
        lows = self._lows
        return lows[bisect_right(lows, start) : bisect_left(lows, end - 1)]

    def find_below(self, start: int, end: int) -> int | None:
        """The first sample from `start` on, before `end`, without forward rotation of the segment."""
        position = bisect_left(self._below, start)
        return self._below[position] if position < len(self._below) and self._below[position] < end else None

    def is_valid(self, first: int, last: int) -> bool:
        """Whether no sample is lost, both ends included."""
        position = bisect_left(self._lost, first)
        return position == len(self._lost) or self._lost[position] > last

    def find_deepest(self, samples: list[int]) -> int:
        """The lowest of some samples, the first if equal."""
        return min(samples, key=self.rate.__getitem__)


def _contact(
    course: _Course, swing: int, end: int, rate_hz: float, params: GyroPeakParams
) -> tuple[float, int] | None:
    """Sample (fractional) of the contact after a swing, and the sample of its detection."""
    rate, crossing = course.rate, course.find_below(swing, end)
    if crossing is None:
        return None
    if params.contact == "zero_cross":
        return crossing - float(rate[crossing] / (rate[crossing] - rate[crossing - 1])), crossing
    lows = course.find_lows(crossing, min(end, crossing + round(params.contact_s * rate_hz) + 1))
    if not lows:
        return None
    low = course.find_deepest(lows)
    return low + _vertex(rate, low), low + 1


def _unclear(rate: Floats, rate_hz: float, params: GyroPeakParams) -> tuple[int, int] | None:
    """Number of peaks just below and above the threshold, if they make the swings unclear."""
    share, most = params.unclear
    low = share * params.swing_rad_s
    # a swing may have a smaller peak beside its own: only what stands for itself counts
    distance = max(1.0, params.apart_s * rate_hz)
    peaks = find_peaks(rate, height=low, prominence=low, distance=distance)
    high_count = int((rate[peaks] >= params.swing_rad_s).sum())
    low_count = len(peaks) - high_count
    return (low_count, high_count) if high_count and low_count > most * high_count else None


def _say_unclear(side: Side, segment: Segment, counts: tuple[int, int], params: GyroPeakParams) -> Notice:
    limit = f"{np.degrees(params.swing_rad_s):.0f}"
    return Notice(
        "swing_unclear",
        plural(
            counts[0],
            Message(
                "{found} swing of the {side} {segment} stays just below {limit}°/s and {found2} "
                "exceed it: {name} would miss many contacts, so it reports none.",
                found=counts[0],
                side=side,
                segment=params.segment,
                limit=limit,
                found2=counts[1],
                name=params.name,
            ),
            Message(
                "{found} swings of the {side} {segment} stay just below {limit}°/s and {found2} "
                "exceed it: {name} would miss many contacts, so it reports none.",
                found=counts[0],
                side=side,
                segment=params.segment,
                limit=limit,
                found2=counts[1],
                name=params.name,
            ),
        ),
        segment,
    )


def _leaving(course: _Course, start: int, swing: int, params: GyroPeakParams) -> int | None:
    """Sample of the minimum before a swing, None without a sufficiently deep one."""
    lows = [k for k in course.find_lows(start, swing) if course.rate[k] <= -params.leaving_rad_s]
    if not lows:
        return None
    return course.find_deepest(lows) if params.leaving == "deepest" else lows[-1]


def _minima(x: Floats) -> np.ndarray:
    """Indices of the local minima of x (n,), ends excluded."""
    return np.flatnonzero((x[1:-1] < x[:-2]) & (x[1:-1] <= x[2:])) + 1


def _vertex(x: Floats, i: int) -> float:
    """Sub-sample offset of the extremum at i, within ±0.5: a parabola through three samples."""
    previous_value, value, next_value = x[i - 1 : i + 2].tolist()
    bend = previous_value - 2.0 * value + next_value
    return 0.0 if bend == 0.0 else float(min(max(0.5 * (previous_value - next_value) / bend, -0.5), 0.5))
