"""Turns of the body while walking or on the spot, from the yaw of its steadiest sensor.

As in El-Gohary et al. 2014 (Sensors 14:356) for a lumbar sensor: the low-passed yaw rate exceeds 15 °/s
somewhere and stays above 5 °/s, neighbouring turns of one direction are merged, 45° or more in 0.5 to 10 s.
Their cut-off of 1.5 Hz passes pelvic rotation, which exceeds 5 °/s in every step of most people; range and
angle are computed at 0.5 Hz here (our choice), the peak velocity at theirs.

Such a slow filter lengthens a turn by a second. Its half height is preserved for turns of any length and
speed: the turn begins and ends where the rate crosses half of its typical value (docs/science/strides.md,
"Turns").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from sagittal.core.frames import Bools, Floats, Oriented, Segment
from sagittal.core.rotation import conjugate, log, multiply
from sagittal.core.signals.filtering import low_pass
from sagittal.core.signals.held_samples import compare_neighbours
from sagittal.core.signals.rest import find_runs

LEVELS: Final[tuple[tuple[Segment, ...], ...]] = (
    ("pelvis",),
    ("chest",),
    ("thigh_l", "thigh_r"),
    ("shank_l", "shank_r"),
    ("foot_l", "foot_r"),
)
"""Sensors that show the turn of the body, the steadiest first."""


@dataclass(frozen=True)
class TurnParams:
    """Criteria for a turn (El-Gohary et al. 2014 unless noted).

    Parameters
    ----------
    peak_rad_s, edge_rad_s : a turn exceeds the first and stays above the second. join_s : longest pause
        between two merged turns of one direction. seconds : shortest and longest duration. angle_rad :
        minimum angle.
    height : fraction of the typical rate of a turn at which it begins and ends. Half, at which a low-pass
        filter preserves the edges of a steady turn; the 22 turns of ipol_walks agree within 0.2 s.
    cutoff_hz, peak_cutoff_hz : of the yaw rate for edges and angle (our choice) and for the peak velocity.
    """

    peak_rad_s: float = float(np.radians(15.0))
    edge_rad_s: float = float(np.radians(5.0))
    join_s: float = 0.05
    seconds: tuple[float, float] = (0.5, 10.0)
    angle_rad: float = float(np.radians(45.0))
    height: float = 0.5
    cutoff_hz: float = 0.5
    peak_cutoff_hz: float = 1.5


@dataclass(frozen=True)
class Turn:
    """One turn.

    Parameters
    ----------
    start_s, end_s : half-open range, s. angle_rad : left positive, including the slower rotation before and
        after this range. peak_rad_s : peak yaw rate, positive.
    """

    start_s: float
    end_s: float
    angle_rad: float
    peak_rad_s: float

    @property
    def duration_s(self) -> float:
        """Length of the turn, s."""
        return self.end_s - self.start_s

    @property
    def direction(self) -> Literal["left", "right"]:
        """Left or right, from the person's perspective."""
        return "left" if self.angle_rad > 0.0 else "right"


def find_turns(
    yaw_rate: Floats, valid: Bools, rate_hz: float, params: TurnParams | None = None
) -> tuple[Turn, ...]:
    """Turns of a recording in chronological order.

    Parameters
    ----------
    yaw_rate : (n,) rad/s about the vertical, left positive. valid : (n,) False where the sensor was lost;
        turns that include such a sample or an end of the recording are not reported because their angle is
        unknown.
    """
    params = params or TurnParams()
    if len(yaw_rate) < rate_hz * params.seconds[0]:
        return ()
    smooth = low_pass(yaw_rate, params.cutoff_hz, rate_hz)
    quick = low_pass(yaw_rate, params.peak_cutoff_hz, rate_hz)
    ranges: list[tuple[int, int]] = []
    for sign in (1.0, -1.0):
        for first, end in _joined(find_runs(sign * smooth > params.edge_rad_s), params.join_s * rate_hz):
            whole = first > 0 and end < len(smooth) and valid[first:end].all()
            if whole and (sign * smooth[first:end]).max() >= params.peak_rad_s:
                ranges.append((first, end))
    listed = []
    for first, end in sorted(ranges):
        start, stop = _half_height(np.abs(smooth[first:end]), params.height)
        listed.append(
            Turn(
                start_s=(first + start) / rate_hz,
                end_s=(first + stop) / rate_hz,
                angle_rad=float(smooth[first:end].sum() / rate_hz),
                peak_rad_s=float(np.abs(quick[first:end]).max()),
            )
        )
    low, high = params.seconds
    return tuple(t for t in listed if abs(t.angle_rad) >= params.angle_rad and low <= t.duration_s <= high)


def body_yaw_rate(take: Oriented, rate_hz: float) -> tuple[Floats, Bools]:
    """Yaw rate (n,) in rad/s of the steadiest segment, or the mean of a pair, and its validity (n,).

    One leg alone is insufficient: its own swing is asymmetric in a turn (by 20° or more).
    """
    n = len(take.t_s)
    levels = [level for level in LEVELS if all(s in take.q for s in level)]
    segments = max(levels, key=lambda level: _share(take.valid, level), default=())
    if not segments:
        return np.zeros(n), np.zeros(n, np.bool_)
    valid = np.logical_and.reduce([take.valid[s] for s in segments])
    rate = np.mean([_vertical_rate(take.q[s]) for s in segments], axis=0) * rate_hz
    return np.asarray(rate), np.asarray(valid)


def _share(valid: Mapping[Segment, Bools], segments: tuple[Segment, ...]) -> float:
    """Fraction of a recording with data of the sensors, in tenths so that the steadier ones win a tie."""
    return round(float(np.logical_and.reduce([valid[s] for s in segments]).mean()), 1)


def _vertical_rate(q: Floats) -> Floats:
    """World z component (n,) of the rotation from each sample to the next, rad."""
    step = compare_neighbours(q, lambda a, b: log(multiply(b, conjugate(a)))[:, 2])
    return np.append(step, step[-1:] if len(step) else 0.0)


def _half_height(rate: Floats, height: float) -> tuple[int, int]:
    """Outermost samples above a fraction of the typical rate of a turn, its angle-weighted mean."""
    indices = np.flatnonzero(rate > height * float((rate**2).sum() / rate.sum()))
    return int(indices[0]), int(indices[-1]) + 1


def _joined(ranges: list[tuple[int, int]], pause: float) -> list[tuple[int, int]]:
    """Index ranges, merged if at most `pause` samples apart."""
    joined: list[tuple[int, int]] = []
    for first, end in ranges:
        if joined and first - joined[-1][1] <= pause:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((first, end))
    return joined
