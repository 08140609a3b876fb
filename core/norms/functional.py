"""References of timed tests in healthy people, by age; only values whose source has been read.

Timed up and go: Bohannon 2006, J Geriatr Phys Ther 29:64, doi:10.1519/00139143-200608000-00004, mean and
upper end of its 95 % confidence interval. Five times sit to stand: Bohannon 2006, Percept Mot Skills 103:215,
doi:10.2466/pms.103.1.215-222, the time above which performance is worse than average (13 papers). Comfortable
speed: Bohannon and Andrews 2011, Physiotherapy 97:182, doi:10.1016/j.physio.2010.12.004, means of 41 papers.
Six minutes: Cazzoletti et al. 2022, Respir Res 23:83, doi:10.1186/s12931-022-02003-y, means and standard
deviations of 287 healthy women and 243 healthy men of the general population.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class TimedTestNorm:
    """Reference of the total time of a test at an age.

    Parameters
    ----------
    ages : first and last year of validity. mean_s : of healthy people, None if only a limit is known.
        limit_s : slower than average above it. source : as printed.
    """

    ages: tuple[int, int]
    mean_s: float | None
    limit_s: float
    source: str


_TUG: Final = "Bohannon 2006, J Geriatr Phys Ther 29:64"
_CHAIR: Final = "Bohannon 2006, Percept Mot Skills 103:215"

TEST_NORMS: Final[dict[str, tuple[TimedTestNorm, ...]]] = {
    "tug_duration_s": (
        TimedTestNorm((60, 69), 8.1, 9.0, _TUG),
        TimedTestNorm((70, 79), 9.2, 10.2, _TUG),
        TimedTestNorm((80, 99), 11.3, 12.7, _TUG),
    ),
    "five_sit_to_stand_s": (
        TimedTestNorm((60, 69), None, 11.4, _CHAIR),
        TimedTestNorm((70, 79), None, 12.6, _CHAIR),
        TimedTestNorm((80, 89), None, 14.8, _CHAIR),
    ),
}
"""Parameter → its references by age."""


def find_test_norm(name: str, age: float | None) -> TimedTestNorm | None:
    """The reference of a total time at an age; None without one or for an unknown age."""
    if age is None:
        return None
    return next((n for n in TEST_NORMS.get(name, ()) if n.ages[0] <= age < n.ages[1] + 1), None)


@dataclass(frozen=True)
class ComfortableSpeedNorm:
    """Mean comfortable speed in m/s of healthy people of one sex, with its age range."""

    ages: tuple[int, int]
    mean_mps: float


COMFORTABLE_SPEED_SOURCE: Final = "Bohannon and Andrews 2011, Physiotherapy 97:182"

_DECADES: Final = ((20, 29), (30, 39), (40, 49), (50, 59), (60, 69), (70, 79), (80, 99))

COMFORTABLE_SPEEDS: Final[dict[str, tuple[float, ...]]] = {
    "male": (1.36, 1.43, 1.43, 1.43, 1.34, 1.26, 0.97),
    "female": (1.34, 1.34, 1.39, 1.31, 1.24, 1.13, 0.94),
}
"""Sex → means by the ages of `_DECADES`."""


def find_comfortable_speed(age: float, sex: str) -> ComfortableSpeedNorm | None:
    """The reference of the ten-metre walk at an age; None without one."""
    rows = zip(_DECADES, COMFORTABLE_SPEEDS.get(sex, ()), strict=False)
    return next((ComfortableSpeedNorm(a, v) for a, v in rows if a[0] <= age < a[1] + 1), None)


@dataclass(frozen=True)
class SixMinuteNorm:
    """Six-minute distance of healthy people of one sex, and their age range."""

    ages: tuple[int, int]
    mean_m: float
    sd_m: float


SIX_MINUTE_SOURCE: Final = "Cazzoletti et al. 2022, Respir Res 23:83"

SIX_MINUTE_NORMS: Final[dict[str, SixMinuteNorm]] = {
    "male": SixMinuteNorm((21, 77), 608.7, 80.1),
    "female": SixMinuteNorm((21, 75), 581.4, 66.5),
}
"""By sex. Their equations, which need weight and activity too, explain a quarter of the variance at most."""


def find_six_minute_norm(age: float, sex: str) -> SixMinuteNorm | None:
    """The reference of the six-minute walk; None without measurements for that age or sex."""
    norm = SIX_MINUTE_NORMS.get(sex)
    return norm if norm is not None and norm.ages[0] <= age < norm.ages[1] + 1 else None
