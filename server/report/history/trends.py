"""Parameters over a patient's visits: changes since the first assessment, and the change required.

All visits have the same walking condition. The first assessment is the base: its measurement error is the
band that a later value must leave to count as a real change (docs/science/change.md, "Verdict"). Trainings
are displayed but never used as the base; those with feedback are not compared with it.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

from sagittal.core.change import Change, find_detectable_change, find_relevant_change, parameter_changes
from sagittal.core.change.limits import Limb
from sagittal.core.frames import SIDES, Side
from sagittal.core.norms import Norms, NormValue
from sagittal.core.parameters.catalogue import CATALOGUE, require_entries
from sagittal.core.parameters.result import Parameter
from sagittal.core.subject.condition import WalkingCondition
from sagittal.server.report.history.numbers import Numbers
from sagittal.server.report.words.change_words import SCORE_TERMS, find_term
from sagittal.server.report.words.wording import Term

VisitKind = Literal["assessment", "training"]

PRIMARY: Final = (
    "gait_speed_mps",
    "cadence_spm",
    "step_length_m",
    "knee_flexion_rom_deg",
    "stance_pct",
    "gps_sagittal_deg",
)
"""Parameters shown by default; if none is available, the first available ones."""

require_entries((name for name in PRIMARY if name not in SCORE_TERMS), "server.report.history.trends")

SCORE_MODE: Final = "offset_removed"
"""Shape without offset: angles are relative to the standing posture of that day."""


@dataclass(frozen=True, eq=False)
class AnalysedVisit:
    """An analysed session.

    Parameters
    ----------
    label : of the planned visit, "PRE" or "T4"; None outside a programme.
    kind : an unplanned session counts as an assessment, one with feedback as a training.
    condition : walking condition. numbers : results.
    """

    session_id: str
    performed_on: dt.date
    title: str
    label: str | None
    kind: VisitKind
    condition: WalkingCondition
    numbers: Numbers

    @property
    def feedback(self) -> bool:
        """Whether feedback was given."""
        return self.condition.feedback


@dataclass(frozen=True)
class TrendPoint:
    """A value at a visit (index into `visits`); `change` from the first assessment, null with feedback.

    `estimated`: from a leg model rather than measured by two sensors.
    """

    visit: int
    value: float
    sd: float | None
    n: int
    ci_low: float | None
    ci_high: float | None
    change: Change | None
    estimated: bool


@dataclass(frozen=True)
class TrendSeries:
    """One side of a parameter, or the whole trial.

    Parameters
    ----------
    points : visits with a value, oldest first. base : index of the first assessment among them, preferably a
        measured one; None = none.
    latest : index of the last assessment after it, None if there is none yet.
    mdc, mcid : around the base; None without a source.
    """

    side: Side | None
    points: tuple[TrendPoint, ...]
    base: int | None
    latest: int | None
    mdc: float | None
    mcid: float | None

    @property
    def start(self) -> float:
        """Value at the base, around which limits are drawn; without a base there are no limits."""
        return self.points[self.base or 0].value

    @property
    def change(self) -> Change | None:
        """Change from the first to the last assessment."""
        return None if self.latest is None else self.points[self.latest].change


@dataclass(frozen=True, eq=False)
class Trend:
    """A parameter over the visits; `norm` = for comparable subjects, None if unavailable."""

    name: str
    term: Term
    lines: tuple[TrendSeries, ...]
    norm: NormValue | None


def names_in(visits: Sequence[AnalysedVisit]) -> tuple[str, ...]:
    """Parameters with a value at any visit, in table order."""
    names = {p.name for visit in visits for p in collect_figures(visit.numbers) if p.mean is not None}
    ordered = (*CATALOGUE, *SCORE_TERMS)
    return (*(n for n in ordered if n in names), *sorted(names.difference(ordered)))


def follow_figures(
    visits: Sequence[AnalysedVisit],
    names: Sequence[str],
    norms: Sequence[Norms] = (),
    usual: Mapping[str, NormValue] | None = None,
    affected: Side | None = None,
) -> tuple[Trend, ...]:
    """Trends of parameters over visits of one condition, oldest first; those without values are omitted.

    Parameters
    ----------
    norms : for the patient, one per visit at its speed; empty = none. A trend shows that of the last visit
        without feedback.
    usual : norms for this age and sex at comfortable speed; the reference for speed itself, which cannot be
        matched by speed.
    affected : side, None = none or both.
    """
    tables = [{(p.name, p.side): p for p in collect_figures(visit.numbers)} for visit in visits]
    trends = []
    last = next((i for i in reversed(range(len(visits))) if not visits[i].feedback), len(visits) - 1)
    for name in names:
        norm = _norm(name, visits, norms[last] if norms else None, usual or {})
        lines = [_line(name, side, visits, tables, norms, affected) for side in (None, *SIDES)]
        series = tuple(line for line in lines if line is not None)
        if series:
            trends.append(Trend(name, find_term(name, _unit(name, tables)), series, norm))
    return tuple(trends)


def collect_figures(numbers: Numbers) -> tuple[Parameter, ...]:
    """Parameters, and the scores of the two legs in the form of parameters."""
    as_parameters = [
        Parameter(s.name, s.side, s.n, s.value, None, s.unit, s.reason)
        for s in numbers.scores
        if s.name in SCORE_TERMS and s.mode == SCORE_MODE and s.side is not None
    ]
    return (*numbers.parameters, *as_parameters)


Table = Mapping[tuple[str, Side | None], Parameter]


def _unit(name: str, tables: Sequence[Table]) -> str:
    return next(p.unit for table in tables for p in table.values() if p.name == name)


def _norm(
    name: str, visits: Sequence[AnalysedVisit], norms: Norms | None, usual: Mapping[str, NormValue]
) -> NormValue | None:
    if name in SCORE_TERMS:
        return _score_norm(name, visits)
    norm = None if norms is None else norms.values.get(name)
    if norm is None and name == "gait_speed_mps":
        norm = usual.get(name)
    return norm if norm is not None and norm.comparable else None


def _score_norm(name: str, visits: Sequence[AnalysedVisit]) -> NormValue | None:
    spread = next(
        (
            s.healthy
            for visit in visits
            for s in visit.numbers.scores
            if (s.name, s.mode) == ("gps_sagittal_deg", SCORE_MODE) and s.side is not None and s.healthy
        ),
        None,
    )
    if spread is None:
        return None
    # GDI* is 100 ± 10 in the reference group by definition
    mean, sd = (spread.mean_deg, spread.sd_deg) if name == "gps_sagittal_deg" else (100.0, 10.0)
    return NormValue(name, mean, sd, None, "healthy adults", "Fukuchi et al. 2018, leave-one-out")


def _line(
    name: str,
    side: Side | None,
    visits: Sequence[AnalysedVisit],
    tables: Sequence[Table],
    norms: Sequence[Norms],
    affected: Side | None,
) -> TrendSeries | None:
    measured = [
        (i, p, p.mean)
        for i, table in enumerate(tables)
        if (p := table.get((name, side))) is not None and p.mean is not None
    ]
    if not measured:
        return None
    assessed = [k for k, (i, _, _) in enumerate(measured) if visits[i].kind == "assessment"]
    base = next((k for k in assessed if not measured[k][1].estimated), assessed[0] if assessed else None)
    first = None if base is None else measured[base][1]

    def change(k: int) -> Change | None:
        i, p, _ = measured[k]
        if first is None or k == base or visits[i].feedback:
            return None
        norm_pair = (norms[measured[base or 0][0]].values, norms[i].values) if norms else None
        return parameter_changes([first], [p], affected, norm_pair)[0]

    points = [
        TrendPoint(i, value, p.sd, p.n, p.ci_low, p.ci_high, change(k), p.estimated)
        for k, (i, p, value) in enumerate(measured)
    ]
    latest = assessed[-1] if base is not None and assessed[-1] > base else None
    mdc, mcid = (None, None) if first is None else _limits(first, points, latest, affected)
    return TrendSeries(side, tuple(points), base, latest, mdc, mcid)


def _limits(
    first: Parameter, points: Sequence[TrendPoint], latest: int | None, affected: Side | None
) -> tuple[float | None, float | None]:
    """Limits for the last assessment or, before there is one, for the next."""
    change = None if latest is None else points[latest].change
    if change is not None and change.difference is not None:
        return change.limit, change.mcid
    limb: Limb | None = None
    if affected is not None and first.side is not None:
        limb = "affected" if first.side == affected else "unaffected"
    mdc = None if first.mean is None else find_detectable_change(first.name, first.mean, limb)
    mcid = find_relevant_change(first.name, limb)
    return None if mdc is None else mdc.value, None if mcid is None else mcid.value
