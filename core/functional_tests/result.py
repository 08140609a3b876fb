"""Result of a functional test: start, end, segments and parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import hypot
from typing import Literal

from sagittal.core.errors import Notice
from sagittal.core.frames import Protocol, Segment
from sagittal.core.parameters.catalogue import CATALOGUE, unit_of
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.variability import NORMAL_95


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
    """Measured functional test.

    Parameters
    ----------
    start_s, end_s : of the test; None if not detected. segments : its parts in chronological order. sensor :
        trunk sensor used, None for feet only. corrected : start or end were given manually.
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
    """One row for every parameter of a test: its value with uncertainty, or the reason why it has none.

    Parameters
    ----------
    values : by name, in the unit of the name. reason : for those missing or None.
    """
    return tuple(_state(name, values.get(name), reason) for name in names)


def _state(name: str, value: float | None, reason: str | None) -> Parameter:
    if value is None:
        return Parameter(name, None, 0, None, None, unit_of(name), reason or "test_not_found")
    errors = CATALOGUE[name].errors
    half_width = None if errors is None else NORMAL_95 * hypot(errors.common, errors.own, errors.random)
    return Parameter(
        name,
        None,
        1,
        value,
        None,
        unit_of(name),
        uncertainty=half_width,
        u_own=None if errors is None else hypot(errors.own, errors.random),
        u_common=None if errors is None else errors.common,
    )


TestPhase = Literal["get_ready", "ready", "running", "done"]
"""get_ready: until the person is quiet; ready: until the person moves; running: the clock runs; done: it
has stopped."""


@dataclass(frozen=True, eq=False)
class GuidedTestView:
    """State of a guided test after the samples so far (core/functional_tests/guided.py).

    Parameters
    ----------
    t_s : of the last evaluated sample. start_s, end_s : of the trial, as far as known. rises : from the
        chair, so far. seconds : fixed duration of the test, None if the person ends it. result : at the end.
        final : later samples do not change it. problem : code of the reason for a missing result or a
        restart.
    """

    protocol: Protocol
    phase: TestPhase
    t_s: float
    start_s: float | None = None
    end_s: float | None = None
    rises: int | None = None
    seconds: float | None = None
    result: FunctionalTest | None = None
    final: bool = False
    problem: str | None = None


def shift_test(test: FunctionalTest, by_s: float) -> FunctionalTest:
    """The same test on an axis that begins earlier by this time, s."""

    def later(t_s: float | None) -> float | None:
        return None if t_s is None else t_s + by_s

    segments = tuple(TimedSegment(s.name, s.start_s + by_s, s.end_s + by_s) for s in test.segments)
    return replace(test, start_s=later(test.start_s), end_s=later(test.end_s), segments=segments)
