"""What a functional test gives: when it began and ended, its segments and its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import hypot

from core.errors import Notice
from core.frames import Segment
from core.parameters.catalogue import CATALOGUE, unit_of
from core.parameters.result import Parameter
from core.parameters.variability import NORMAL_95


@dataclass(frozen=True)
class TimedSegment:
    """A named part of a test, s from the start of the recording."""

    name: str
    start_s: float
    end_s: float

    @property
    def duration_s(self) -> float:
        """Length of the part, s."""
        return self.end_s - self.start_s


@dataclass(frozen=True, eq=False)
class FunctionalTest:
    """A functional test as measured.

    Parameters
    ----------
    start_s, end_s : of the test; None where they were not found. segments : its parts in order of time.
    sensor : the trunk sensor that tells, None where feet alone do.
    corrected : a person said when it began or ended.
    """

    start_s: float | None
    end_s: float | None
    segments: tuple[TimedSegment, ...]
    parameters: tuple[Parameter, ...]
    sensor: Segment | None = None
    corrected: bool = False
    notices: tuple[Notice, ...] = ()


def state_figures(
    values: Mapping[str, float | None], names: tuple[str, ...], reason: str | None
) -> tuple[Parameter, ...]:
    """A row for every name of a test: its value with what it is known to, or the reason why it has none.

    Parameters
    ----------
    values : by name, in the unit of the name. reason : of those that are missing or None.
    """
    return tuple(_state(name, values.get(name), reason) for name in names)


def _state(name: str, value: float | None, reason: str | None) -> Parameter:
    if value is None:
        return Parameter(name, None, 0, None, None, unit_of(name), reason or "test_not_found")
    errors = CATALOGUE[name].errors
    known = None if errors is None else NORMAL_95 * hypot(errors.common, errors.own, errors.random)
    return Parameter(
        name,
        None,
        1,
        value,
        None,
        unit_of(name),
        uncertainty=known,
        u_own=None if errors is None else hypot(errors.own, errors.random),
        u_common=None if errors is None else errors.common,
    )
