"""Turns of the body while walking or on the spot, from the yaw of its steadiest sensor.

As El-Gohary et al. 2014 (Sensors 14:356) find them for a lumbar sensor: the low-passed yaw rate exceeds
15 °/s somewhere and stays above 5 °/s, neighbours of one direction are one turn, 45° or more in 0.5 to 10 s.
Their 1.5 Hz lets the pelvis' own rotation through, more than 5 °/s with every step of most people; range and
angle are taken at 0.5 Hz here (our choice), the peak velocity at theirs.

So slow a filter makes a turn a second longer than it was. Its half height stays where it is, for a turn of
any length and speed: the turn begins and ends where the rate passes half of what is typical of it
(docs/science/strides.md, "Turns").
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
    """What counts as a turn (El-Gohary et al. 2014 where not said otherwise).

    Parameters
    ----------
    peak_rad_s, edge_rad_s : a turn exceeds the first and stays above the second. join_s : pause between two
        turns of one direction that are one. seconds : shortest and longest. angle_rad : least.
    height : share of the typical rate of a turn at which it begins and ends. Half, where a low-pass filter
        leaves the edges of a steady turn; the 22 turns of ipol_walks agree within 0.2 s.
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
    start_s, end_s : half-open range, s. angle_rad : left positive, of all that belongs to the turn: what is
        turned more slowly before and after this range too. peak_rad_s : greatest yaw rate, positive.
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
        """Left or right, as the person sees it."""
        return "left" if self.angle_rad > 0.0 else "right"


def find_turns(
    yaw_rate: Floats, valid: Bools, rate_hz: float, params: TurnParams | None = None
) -> tuple[Turn, ...]:
    """Turns of a take in order of time.

    Parameters
    ----------
    yaw_rate : (n,) rad/s about the vertical, left positive. valid : (n,) False where the sensor was lost; no
        turn is reported that touches such a sample or an end of the take: how far it went nobody saw.
    """
    params = params or TurnParams()
    if len(yaw_rate) < rate_hz * params.seconds[0]:
        return ()
    smooth = low_pass(yaw_rate, params.cutoff_hz, rate_hz)
    quick = low_pass(yaw_rate, params.peak_cutoff_hz, rate_hz)
    found: list[tuple[int, int]] = []
    for sign in (1.0, -1.0):
        for first, end in _joined(find_runs(sign * smooth > params.edge_rad_s), params.join_s * rate_hz):
            whole = first > 0 and end < len(smooth) and valid[first:end].all()
            if whole and (sign * smooth[first:end]).max() >= params.peak_rad_s:
                found.append((first, end))
    listed = []
    for first, end in sorted(found):
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
    """Yaw rate (n,) in rad/s of the steadiest segment, or the mean of a pair, and where it is known (n,).

    One leg alone does not tell: its own swing is not even over a turn (20° and more).
    """
    n = len(take.t_s)
    levels = [level for level in LEVELS if all(s in take.q for s in level)]
    worn = max(levels, key=lambda level: _share(take.valid, level), default=())
    if not worn:
        return np.zeros(n), np.zeros(n, np.bool_)
    valid = np.logical_and.reduce([take.valid[s] for s in worn])
    rate = np.mean([_vertical_rate(take.q[s]) for s in worn], axis=0) * rate_hz
    return np.asarray(rate), np.asarray(valid)


def _share(valid: Mapping[Segment, Bools], worn: tuple[Segment, ...]) -> float:
    """How much of a take sensors saw, in tenths so that the steadier ones win a tie."""
    return round(float(np.logical_and.reduce([valid[s] for s in worn]).mean()), 1)


def _vertical_rate(q: Floats) -> Floats:
    """World z component (n,) of the rotation from each sample to the next, rad."""
    step = compare_neighbours(q, lambda a, b: log(multiply(b, conjugate(a)))[:, 2])
    return np.append(step, step[-1:] if len(step) else 0.0)


def _half_height(rate: Floats, height: float) -> tuple[int, int]:
    """Outermost samples above a share of the typical rate of a turn, the mean over its angle."""
    above = np.flatnonzero(rate > height * float((rate**2).sum() / rate.sum()))
    return int(above[0]), int(above[-1]) + 1


def _joined(found: list[tuple[int, int]], pause: float) -> list[tuple[int, int]]:
    """Index ranges, those with at most `pause` samples between them joined."""
    joined: list[tuple[int, int]] = []
    for first, end in found:
        if joined and first - joined[-1][1] <= pause:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((first, end))
    return joined
