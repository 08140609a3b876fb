"""Slips that strides show without a joint: of any sensor of pelvis and legs, in any plane, and slow ones.

Each sensor is judged by itself, so feet alone and feet with a pelvis are judged as well. A slip turns
gravity in the sensor at one moment, for good, in both witnesses alike (stride_gravity.py); about the vertical
it turns the axis about which the segment swings. A slope or another gait turns several sensors at one time:
then none is accused. Limits: docs/science/agreement.md, "Slips without a joint".
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from math import radians, sqrt
from typing import Final

import numpy as np

from sagittal.core.agreement.slips import SensorSlip
from sagittal.core.agreement.stride_gravity import (
    StrideGravity,
    cut_strides,
    find_typical,
    measure_stride_gravity,
)
from sagittal.core.errors import Notice
from sagittal.core.frames import Floats, Segment
from sagittal.core.message import Message
from sagittal.core.rotation import find_lengths
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import Window

LEAST_TILT: Final = radians(6.0)
"""Smallest tilt that is reported. Clean recordings reach 4.8° (ipol_walks, subject 11)."""
LEAST_TWIST: Final = radians(17.0)
"""Smallest turn about the vertical. Clean ones reach 6.8°, a paretic foot that hardly swings 14.9°."""
STRIDES: Final = 3
"""Strides needed on both sides."""
REACH: Final = 8
"""Strides compared on both sides."""
SCATTER: Final = 3.0
"""Least ratio of a turn to its standard deviation."""
FLOOR: Final = radians(1.0)
"""Least scatter of one stride."""
LASTING: Final = 0.75
"""Share of all strides that must be on their side, before and after."""
ALONE: Final = 0.5
"""Largest turn of another sensor at the same time, over this one."""
SAME_S: Final = 3.0
"""Turns so near in time are one event."""
LEAST_CREEP: Final = radians(7.0)
CREEP_SCATTER: Final = 4.0
"""Smallest slow turn over the walk, and its ratio to its standard deviation. Clean ones reach 5.9°."""
CREEP_STRIDES: Final = 8
WITHIN_S: Final = 2.0
"""Angles so near a slip are left out, at least."""

DENYING: Final = 4
LEAST_DENYING: Final = 2
"""Flat moments on either side of a slip that a joint claims, at most and at least."""

CREEPS: Final = "sensor_creeps"


@dataclass(frozen=True)
class StrideTurn:
    """A lasting turn of a sensor: stride after which it is, rotation vector (3,) rad, standard deviation."""

    stride: int
    turn: Floats
    sd: float

    @property
    def size(self) -> float:
        """Angle, rad."""
        return float(np.linalg.norm(self.turn))


def find_stride_slips(
    recording: UniformRecording, known: Collection[Segment] = ()
) -> tuple[tuple[SensorSlip, ...], dict[Segment, Window], tuple[Notice, ...]]:
    """Slips by gravity of strides; sensor → from when to when one would be seen; notices of slow ones.

    Parameters
    ----------
    known : sensors of which a slip was found already; they are not judged again.
    """
    found: dict[Segment, SensorSlip] = {}
    judged: dict[Segment, Window] = {}
    slow: list[Notice] = []
    for segment, borders in cut_strides(recording).items():
        if segment in known:
            continue
        signals = recording.sensors[segment]
        strides = measure_stride_gravity(segment, signals, borders, recording.rate_hz)
        if len(strides.at_s) < 2 * STRIDES:
            continue
        judged[segment] = float(strides.at_s[STRIDES - 1]), float(strides.at_s[-STRIDES])
        slip = _find_slip(segment, strides)
        if slip is not None:
            found[segment] = slip
        elif (turn := measure_creep(strides)) is not None:
            slow.append(_tell_creep(segment, turn))
    return _keep_lonely(found), judged, tuple(slow)


def deny_slip(recording: UniformRecording, slip: SensorSlip) -> bool:
    """Whether the flat moments of a foot deny a slip that its joint claims: they turn by under half of it."""
    if not slip.segment.startswith("foot") or slip.at_rest:
        return False
    borders = cut_strides(recording)[slip.segment]
    strides = measure_stride_gravity(
        slip.segment, recording.sensors[slip.segment], borders, recording.rate_hz
    )
    before = strides.moment[strides.at_s < slip.at_s - 0.5 * slip.within_s][-DENYING:]
    after = strides.moment[strides.at_s > slip.at_s + 0.5 * slip.within_s][:DENYING]
    if min(len(before), len(after)) < LEAST_DENYING:
        return False
    a, b = find_typical(before), find_typical(after)
    return bool(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b) < 0.5 * abs(slip.turn_rad))


def _find_slip(segment: Segment, strides: StrideGravity) -> SensorSlip | None:
    tilt = find_tilt(strides)
    step = tilt if tilt is not None else find_twist(segment, strides)
    if step is None:
        return None
    before, after = strides.at_s[step.stride - 1], strides.at_s[step.stride]
    along = tuple(float(v) for v in step.turn / step.size)
    return SensorSlip(
        segment,
        float(0.5 * (before + after)),
        max(WITHIN_S, float(after - before)),
        step.size,
        step.sd,
        along,  # type: ignore[arg-type]
        by="strides",
    )


def _keep_lonely(found: Mapping[Segment, SensorSlip]) -> tuple[SensorSlip, ...]:
    """Without turns that several sensors show at one time: a slope, or another gait."""
    return tuple(
        x
        for s, x in found.items()
        if not any(
            other != s and abs(y.at_s - x.at_s) < SAME_S and y.turn_rad > ALONE * x.turn_rad
            for other, y in found.items()
        )
    )


def find_tilt(strides: StrideGravity) -> StrideTurn | None:
    """The largest lasting turn of gravity that both witnesses show."""
    moment, whole = strides.moment, strides.whole
    best: StrideTurn | None = None
    for k in _list_places(moment, whole):
        steps = [_compare(u, k) for u in (moment, whole)]
        if any(share <= LASTING for _, _, share in steps):
            continue
        (a, sd_a, _), (b, sd_b, _) = steps
        x, y = float(np.linalg.norm(a)), float(np.linalg.norm(b))
        if min(x, y) < LEAST_TILT or min(x, y) < 0.5 * max(x, y) or float(a @ b) < 0.8 * x * y:
            continue
        if min(x / sd_a, y / sd_b) < SCATTER:
            continue
        if best is None or min(x, y) > best.size:
            best = StrideTurn(k, 0.5 * (a + b), max(sd_a, 0.5 * abs(x - y)))
    return best


def find_twist(segment: Segment, strides: StrideGravity) -> StrideTurn | None:
    """The largest lasting turn about gravity of the axis a leg swings about; a pelvis has none."""
    x, best = strides.heading, None
    if segment == "pelvis":
        return None
    for k in range(STRIDES, len(x) - STRIDES + 1):
        a, b = x[max(0, k - REACH) : k], x[k : k + REACH]
        turn = float(np.median(b) - np.median(a))
        if abs(turn) < LEAST_TWIST:
            continue
        one = 1.2 * max(FLOOR, *(float(np.median(np.abs(y - np.median(y)))) for y in (a, b)))
        sd = one * sqrt(1.0 / len(a) + 1.0 / len(b))
        way = (x - np.median(a)) / turn
        lasting = min(float(np.mean(way[k:] > 0.5)), float(np.mean(way[:k] < 0.5)))
        if abs(turn) > SCATTER * sd and lasting > LASTING and (best is None or abs(turn) > best.size):
            best = StrideTurn(k, turn * find_typical(strides.whole), sd)
    return best


def measure_creep(strides: StrideGravity) -> float | None:
    """Turn over the walk, rad, where gravity turns steadily in both witnesses; else None."""
    n = len(strides.at_s)
    if n < CREEP_STRIDES:
        return None
    turns = []
    for u in (strides.moment, strides.whole):
        turn, sd = _fit_trend(u)
        if np.linalg.norm(turn) < max(LEAST_CREEP, CREEP_SCATTER * sd):
            return None
        turns.append(turn)
    a, b = (float(np.linalg.norm(x)) for x in turns)
    return 0.5 * (a + b) if float(turns[0] @ turns[1]) > 0.8 * a * b else None


def _fit_trend(u: Floats) -> tuple[Floats, float]:
    """Turn (3,) from the first stride to the last by medians of far pairs, and its standard deviation."""
    n = len(u)
    thinned = u[np.unique(np.linspace(0, n - 1, min(n, 60)).astype(np.int64))]
    m = len(thinned)
    i, j = np.triu_indices(m, max(1, m // 3))
    bent = np.cross(find_typical(u), thinned)
    turn = np.median((bent[j] - bent[i]) / (j - i)[:, None], axis=0) * (m - 1)
    left = bent - np.outer(np.arange(m) - 0.5 * (m - 1), turn / (m - 1))
    spread = 1.4826 * float(np.median(find_lengths(left - np.median(left, axis=0))))
    return turn, max(spread, 0.7 * FLOOR) * sqrt(12.0 / m)


def _list_places(moment: Floats, whole: Floats) -> list[int]:
    """Strides before which the mean of some strides differs enough from those before to be looked at."""
    n = len(moment)
    k = np.arange(STRIDES, n - STRIDES + 1)
    far = np.ones(len(k), np.bool_)
    for u in (moment, whole):
        total = np.concatenate((np.zeros((1, 3)), np.cumsum(u, axis=0)))
        first, past = np.maximum(k - REACH, 0), np.minimum(k + REACH, n)
        before = (total[k] - total[first]) / (k - first)[:, None]
        after = (total[past] - total[k]) / (past - k)[:, None]
        far &= find_lengths(after - before) > 0.5 * LEAST_TILT
    places: list[int] = k[far].tolist()
    return places


def _compare(u: Floats, k: int) -> tuple[Floats, float, float]:
    """Turn (3,) from before stride k to after it, its standard deviation, share of strides on their side."""
    before, after = u[max(0, k - REACH) : k], u[k : k + REACH]
    a, b = find_typical(before), find_typical(after)
    across = np.cross(a, b)
    sine = float(np.linalg.norm(across))
    turn = across / max(sine, 1e-12) * np.arctan2(sine, float(a @ b))
    one = 1.2 * max(FLOOR / 1.2, _scatter(before, a), _scatter(after, b))
    way = (u - a) @ (b - a) / max(float((b - a) @ (b - a)), 1e-12)
    lasting = min(float(np.mean(way[k:] > 0.5)), float(np.mean(way[:k] < 0.5)))
    return turn, one * sqrt(1.0 / len(before) + 1.0 / len(after)), lasting


def _scatter(u: Floats, middle: Floats) -> float:
    return float(np.median(np.arctan2(find_lengths(np.cross(u, middle)), u @ middle)))


def _tell_creep(segment: Segment, turn: float) -> Notice:
    return Notice(
        CREEPS,
        Message(
            "The sensor on {segment} slipped slowly, by {turn:.0f}° over the walk. Levels of its angles are "
            "unreliable. Fasten the sensor and record again.",
            segment=segment,
            turn=np.degrees(turn),
        ),
        segment,
    )
