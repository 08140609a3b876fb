"""Start, lowest point and end of squats, from knee flexion.

docs/science/squat.md, "Repetitions".
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import radians
from typing import Final

import numpy as np

from sagittal.core.errors import ParameterError
from sagittal.core.frames import Bools, Floats, Side
from sagittal.core.signals.peaks import find_peaks

FOOT_LIFTED: Final = "foot_lifted"
CODES: Final = (FOOT_LIFTED, "incomplete", "signal_lost", "foot_moved")
"""Why a bending knee does not count: its foot was off the floor, so that the other leg may have squatted; the
take cut it; a sensor was silent in it; the foot moved."""


@dataclass(frozen=True)
class RepetitionParams:
    """Criteria for a squat (our choice).

    Parameters
    ----------
    least_rad : knee flexion relative to the straighter position before and after.
    edge : fraction of this flexion at which a repetition begins and ends.
    level : fraction at which the knee counts as extended: without reaching it, a movement belongs to the same
    repetition.
    lifted : fraction of a movement in which the foot may be off the floor.
    foot_rate : mean rate of the foot sensor in a repetition above which the foot counts as moving, rad/s.

    Raises
    ------
    ParameterError `parameter_out_of_range`.
    """

    least_rad: float = radians(20.0)
    edge: float = 0.05
    level: float = 0.5
    lifted: float = 0.2
    foot_rate: float = radians(10.0)

    def __post_init__(self) -> None:
        shares = 0.0 < self.edge < self.level < 1.0 and 0.0 < self.lifted < 1.0
        if not (self.least_rad > 0.0 and shares and self.foot_rate > 0.0):
            raise ParameterError(
                "parameter_out_of_range",
                "A repetition needs 0 < edge < level < 1, 0 < lifted < 1, and a least flexion and foot rate "
                "above 0.",
            )


@dataclass(frozen=True)
class Repetition:
    """One squat; times in s from the start of the recording.

    Parameters
    ----------
    first, bottom, last : samples of its start, lowest point and end.
    excluded : None if valid, else one of `CODES`.
    """

    side: Side
    first: int
    bottom: int
    last: int
    start_s: float
    bottom_s: float
    end_s: float
    excluded: str | None = None

    @property
    def descent_s(self) -> float:
        """From the start to the lowest point."""
        return self.bottom_s - self.start_s

    @property
    def ascent_s(self) -> float:
        """From the lowest point to the end."""
        return self.end_s - self.bottom_s


def find_repetitions(
    knee: Floats,
    t_s: Floats,
    side: Side,
    foot_rate: Floats | None = None,
    params: RepetitionParams | None = None,
    stands: Bools | None = None,
) -> tuple[Repetition, ...]:
    """Detect squats from the flexion of a knee.

    Parameters
    ----------
    knee : (n,) rad, NaN where unknown. t_s : (n,).
    foot_rate : (n,) |ω| of the sensor on the supporting foot, rad/s, None without one.
    stands : (n,) False where the foot is lifted; None = never lifted.

    Returns
    -------
    Repetitions in order, excluded ones with their reason. A squat during which the knee is unknown throughout
    is not detected.
    """
    params = params or RepetitionParams()
    is_known = np.isfinite(knee)
    if is_known.sum() < 2:
        return ()
    # a bridge over silences, so that a squat with one in it is found and excluded
    bridged = np.interp(t_s, t_s[is_known], knee[is_known])
    begins, ends = np.flatnonzero(is_known)[[0, -1]]
    repetitions = []
    for preceding, bottom, following in _find_bottoms(bridged, params):
        first, last = _find_edges(bridged, preceding, bottom, following, params)
        part = slice(first, last + 1)
        down, up = bridged[bottom] - bridged[first], bridged[bottom] - bridged[last]
        cut = (first <= begins or last >= ends) and min(down, up) < params.level * max(down, up)
        reason = None
        if stands is not None and float(np.mean(~stands[part])) > params.lifted:
            reason = FOOT_LIFTED
        elif cut:
            reason = "incomplete"
        elif not is_known[part].all():
            reason = "signal_lost"
        elif foot_rate is not None and float(np.mean(foot_rate[part])) > params.foot_rate:
            reason = "foot_moved"
        start_s, bottom_s, end_s = (float(t_s[k]) for k in (first, bottom, last))
        repetitions.append(Repetition(side, first, bottom, last, start_s, bottom_s, end_s, reason))
    return tuple(repetitions)


def _find_bottoms(knee: Floats, params: RepetitionParams) -> list[tuple[int, int, int]]:
    """For each squat the straightest sample before it, the deepest, and the straightest after it."""
    # at the ends as straight as ever, so that a squat that the take cuts is a peak too
    low = float(knee.min())
    peaks = find_peaks(np.concatenate(([low], knee, [low])), prominence=params.least_rad) - 1
    bottoms: list[int] = []
    for peak in peaks.tolist():
        if bottoms:
            last = bottoms[-1]
            top, valley = min(knee[last], knee[peak]), knee[last : peak + 1].min()
            if valley - low > params.level * (top - low):
                bottoms[-1] = max(last, peak, key=lambda k: float(knee[k]))
                continue
        bottoms.append(peak)
    straightest = [a + int(np.argmin(knee[a : b + 1])) for a, b in pairwise(bottoms)]
    starts, ends = [0, *straightest], [*straightest, len(knee) - 1]
    return list(zip(starts, bottoms, ends, strict=False))


def _find_edges(
    knee: Floats, preceding: int, bottom: int, following: int, params: RepetitionParams
) -> tuple[int, int]:
    """Last sample before and first after the deepest one at which the knee is nearly extended."""
    down, up = knee[preceding : bottom + 1], knee[bottom : following + 1]
    start = down.min() + params.edge * (knee[bottom] - down.min())
    end = up.min() + params.edge * (knee[bottom] - up.min())
    return preceding + int(np.flatnonzero(down <= start)[-1]), bottom + int(np.flatnonzero(up <= end)[0])
