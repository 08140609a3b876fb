"""Planned visits of a training programme, relative to its first training (docs/science/feedback.md)."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

VisitKind = Literal["assessment", "training"]


@dataclass(frozen=True)
class CourseVisit:
    """A visit of a template: `day` counted from the first training, `week` from 1 (0 = the week before)."""

    label: str
    kind: VisitKind
    day: int

    @property
    def week(self) -> int:
        """Week of the programme."""
        return self.day // 7 + 1


@dataclass(frozen=True)
class Course:
    """Template of a training programme: its visits in order.

    Parameters
    ----------
    words : one-line description. source : origin of the template.
    """

    name: str
    words: str
    source: str
    visits: tuple[CourseVisit, ...]

    def days(self, starts_on: dt.date) -> tuple[dt.date, ...]:
        """Dates of the visits for a given date of the first training."""
        return tuple(starts_on + dt.timedelta(days=visit.day) for visit in self.visits)


_TRAINING_WEEKS: Final = (0, 1, 2, 4, 5, 6)
_TRAINING_DAYS: Final = (0, 2, 4)
_REST_WEEK: Final = 3
_LAST_TRAINING: Final = 7 * _TRAINING_WEEKS[-1] + _TRAINING_DAYS[-1]


def _six_weeks() -> tuple[CourseVisit, ...]:
    days = [7 * week + day for week in _TRAINING_WEEKS for day in _TRAINING_DAYS]
    visits = [CourseVisit(f"T{i}", "training", day) for i, day in enumerate(days, 1)]
    visits += [
        CourseVisit("PRE", "assessment", -7),
        CourseVisit("MID", "assessment", 7 * _REST_WEEK + 2),
        CourseVisit("POST1", "assessment", _LAST_TRAINING + 7),
        CourseVisit("POST6", "assessment", _LAST_TRAINING + 42),
    ]
    return tuple(sorted(visits, key=lambda visit: visit.day))


SIX_WEEKS: Final = Course(
    "six_weeks",
    "18 trainings, 3 a week, rest and assessment in week 4; assessments 1 week before, 1 and 6 weeks after",
    "course protocol of the thesis, ch. 8",
    _six_weeks(),
)

COURSES: Final[Mapping[str, Course]] = {SIX_WEEKS.name: SIX_WEEKS}
"""Templates by name."""
