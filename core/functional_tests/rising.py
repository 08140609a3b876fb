"""Detection of rising from a chair and sitting down, from the height and inclination of the trunk
(docs/science/timed-tests.md, "Rising and sitting down").

If the trunk moves up or down by a considerable part of the thigh length, while leaning forward and back, the
person rises or sits down. The transition lasts from where the trunk leans forward at a tenth of its maximum
rate to where it leans back at less than a tenth of that.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Final, Literal

import numpy as np

from sagittal.core.frames import Floats
from sagittal.core.functional_tests.trunk import TrunkMotion
from sagittal.core.signals.filtering import low_pass
from sagittal.core.signals.rest import find_runs

ChangeKind = Literal["sit_to_stand", "stand_to_sit"]

SIT_TO_STAND: Final = "sit_to_stand"
STAND_TO_SIT: Final = "stand_to_sit"


MARGINS_S: Final = (0.0, 0.1, 0.2, 0.3, 0.4)
"""The change of height is integrated from so long before a change to so long after it."""


@dataclass(frozen=True)
class RisingParams:
    """Criteria for rising and sitting down (our choices).

    Parameters
    ----------
    height_m : minimum change of trunk height. speed_mps : minimum vertical speed, low-passed. lean_rad :
        minimum lean forward and back. edge : fraction of the maximum rate of leaning forward, and back, at
        which the transition begins and ends.
    band_hz : of the vertical speed used for detection: above drift, below steps. lean_hz : cut-off of the
        lean. reach_s : largest distance of the lean from the fastest moment.
    """

    height_m: float = 0.12
    speed_mps: float = 0.10
    lean_rad: float = radians(8.0)
    edge: float = 0.1
    band_hz: tuple[float, float] = (0.1, 0.7)
    lean_hz: float = 2.0
    reach_s: float = 2.5


@dataclass(frozen=True)
class PostureChange:
    """One rising or sitting down.

    Parameters
    ----------
    start_s, end_s : start and end of the lean. fastest_s : time of maximum vertical speed. height_m : change
        of trunk height, positive up. lean_rad : maximum forward lean relative to the start. forward_rad_s,
        back_rad_s : maximum rates of leaning forward and back, positive.
    """

    kind: ChangeKind
    start_s: float
    end_s: float
    fastest_s: float
    height_m: float
    lean_rad: float
    forward_rad_s: float
    back_rad_s: float

    @property
    def duration_s(self) -> float:
        """Duration of the transition, s."""
        return self.end_s - self.start_s


def find_changes(trunk: TrunkMotion, params: RisingParams | None = None) -> tuple[PostureChange, ...]:
    """All rising and sitting down in a recording, in chronological order."""
    params = params or RisingParams()
    rate = trunk.rate_hz
    if len(trunk.t_s) < rate * 3.0:
        return ()
    speed = _vertical_speed(trunk, params)
    extremes = []
    for sign in (1.0, -1.0):
        for first, end in find_runs(sign * speed > 0.3 * params.speed_mps):
            fastest = first + int(np.argmax(sign * speed[first:end]))
            if sign * speed[fastest] >= params.speed_mps and trunk.valid[first:end].all():
                extremes.append((fastest, sign))
    extremes.sort()
    rows = (
        (fastest, sign, _cut_out(extremes, i, speed, rate, params))
        for i, (fastest, sign) in enumerate(extremes)
    )
    changes = (_measure(trunk, fastest, sign, part, params) for fastest, sign, part in rows)
    return tuple(c for c in changes if c is not None)


def _cut_out(
    extremes: list[tuple[int, float]], i: int, speed: Floats, rate_hz: float, params: RisingParams
) -> tuple[int, int]:
    """Samples around one fastest moment that contain no other transition of its size."""
    fastest, _ = extremes[i]
    reach = round(params.reach_s * rate_hz)
    rivals = [k for k, _ in extremes if k != fastest and abs(speed[k]) >= 0.5 * abs(speed[fastest])]
    previous_rival = max((k for k in rivals if k < fastest), default=fastest - 2 * reach)
    next_rival = min((k for k in rivals if k > fastest), default=fastest + 2 * reach)
    low, high = (
        max(fastest - reach, (previous_rival + fastest) // 2),
        min(fastest + reach, (fastest + next_rival) // 2),
    )
    return max(0, low), min(len(speed), high + 1)


def _vertical_speed(trunk: TrunkMotion, params: RisingParams) -> Floats:
    """Vertical speed (n,) in m/s, band-passed between drift and steps."""
    low, high = params.band_hz
    speed = np.cumsum(trunk.upward) / trunk.rate_hz
    return low_pass(speed - low_pass(speed, low, trunk.rate_hz), high, trunk.rate_hz)


def _measure(
    trunk: TrunkMotion, at: int, sign: float, part: tuple[int, int], params: RisingParams
) -> PostureChange | None:
    """The transition around its fastest sample; None if trunk height and lean contradict it."""
    rate, (low, high) = trunk.rate_hz, part
    if high - low < 0.5 * rate:
        return None
    lean = _lean(trunk, low, high, params)
    speed = np.gradient(lean) * rate
    peak = _greatest_lean(lean, speed, at - low, rate)
    if peak is None:
        return None
    forward = int(np.argmax(speed[: peak + 1]))
    back = peak + int(np.argmin(speed[peak:]))
    start_candidates = np.flatnonzero(speed[: forward + 1] < params.edge * speed[forward])
    end_candidates = np.flatnonzero(speed[back:] > params.edge * speed[back])
    if not len(start_candidates) or not len(end_candidates):
        return None
    start, end = int(start_candidates[-1]) + 1, back + int(end_candidates[0])
    bow = float(lean[peak] - lean[start])
    height = _height_change(trunk, low + start, low + end)
    if bow < params.lean_rad or sign * height < params.height_m:
        return None
    return PostureChange(
        SIT_TO_STAND if sign > 0.0 else STAND_TO_SIT,
        start_s=(low + start) / rate,
        end_s=(low + end) / rate,
        fastest_s=at / rate,
        height_m=height,
        lean_rad=bow,
        forward_rad_s=float(speed[forward]),
        back_rad_s=float(-speed[back]),
    )


def _lean(trunk: TrunkMotion, low: int, high: int, params: RisingParams) -> Floats:
    """Lean (n,) in rad in the plane of the largest lean, forward positive.

    The trunk leans forward and back within a transition, so the larger excursion from the line between its
    ends is forward.
    """
    up = low_pass(trunk.up[low:high].T, params.lean_hz, trunk.rate_hz).T
    ramp = np.linspace(0.0, 1.0, len(up))[:, None]
    apart = up - (up[:1] + ramp * (up[-1:] - up[:1]))
    _, _, axes = np.linalg.svd(apart - apart.mean(axis=0), full_matrices=False)
    way = apart @ axes[0]
    sign = 1.0 if way.max() > -way.min() else -1.0
    middle = up.mean(axis=0)
    return np.asarray(np.arctan2(sign * (up @ axes[0]), up @ (middle / np.linalg.norm(middle))))


def _greatest_lean(lean: Floats, speed: Floats, fastest: int, rate_hz: float) -> int | None:
    """Sample of the maximum lean, near the fastest vertical movement."""
    near = round(1.5 * rate_hz)
    low, high = max(1, fastest - near), min(len(lean) - 1, fastest + near)
    if high - low < 3:
        return None
    ramp = np.interp(np.arange(len(lean)), [low, high], [lean[low], lean[high]])
    return low + int(np.argmax((lean - ramp)[low:high]))


def _height_change(trunk: TrunkMotion, start: int, end: int) -> float:
    """Change of height in m: the vertical acceleration integrated twice between two slow moments.

    Their residual speed is unknown, so the median over several margins is used.
    """
    heights = []
    for margin in MARGINS_S:
        reach = round(margin * trunk.rate_hz)
        part = slice(max(0, start - reach), min(len(trunk.t_s), end + reach))
        speed = np.cumsum(trunk.upward[part]) / trunk.rate_hz
        # slow at both ends: what is left there is drift
        speed -= np.linspace(speed[0], speed[-1], len(speed))
        heights.append(float(speed.sum() / trunk.rate_hz))
    return float(np.median(heights))
