"""Report model of pages, print and API: bundle and norms to degrees and words, without signals.

A pure function of stored results (law 10): under 50 ms for a 10 min session.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Final, Literal

import numpy as np

from sagittal.core.errors import Notice, title_of_code
from sagittal.core.events.result import Stride
from sagittal.core.flags import Flag, judge_flags
from sagittal.core.frames import SIDES, Side
from sagittal.core.norms.adults import adult_reference_at_speed
from sagittal.core.norms.controls import ControlGroup
from sagittal.core.norms.lookup import Norms, look_up_norms
from sagittal.core.norms.profile import CurveReference
from sagittal.core.norms.scores import Scores, score_curves
from sagittal.core.parameters import cycle_curves
from sagittal.core.parameters.anatomical_zero import anatomical_variables
from sagittal.core.parameters.result import CycleCurves, Parameter
from sagittal.core.parameters.uncertainty import mark_estimated
from sagittal.server.report.charts.panels import CurvePanel, curve_panels
from sagittal.server.report.files.bundle import Bundle
from sagittal.server.report.files.columns import reduce_to_plain
from sagittal.server.report.view.daily_life import DailyLifeView, daily_life_view
from sagittal.server.report.view.functional import TEST_NORM_NOTE, FunctionalView, functional_view
from sagittal.server.report.view.headline import Headline, say_badge
from sagittal.server.report.view.key_numbers import KeyNumber, choose_key_numbers
from sagittal.server.report.view.level import choose_zero, level_rows
from sagittal.server.report.view.model_json import panel_json, profile_json, round_curve
from sagittal.server.report.view.notes import curve_notes, norm_note
from sagittal.server.report.view.profile import ProfileView, profile_view
from sagittal.server.report.view.quality_box import QualityBox, quality_box
from sagittal.server.report.view.squat import NORM_NOTE, UNSURE_FIGURES, SquatView, squat_view
from sagittal.server.report.view.standouts import find_standouts
from sagittal.server.report.view.table import ParameterRow, group_rows, parameter_rows
from sagittal.server.report.words.estimator import (
    EstimatorView,
    estimator_view,
    list_estimated_angles,
    list_estimated_variables,
)
from sagittal.server.report.words.limits import LimitsView, limits_view
from sagittal.server.report.words.wording import explain_exclusion, place_words, speak_places

Sex = Literal["female", "male"]

KEY_CURVE: Final = "knee_flexion"

_KINDS: Final = {"error": "bad", "warning": "warn", "info": "info"}


@dataclass(frozen=True)
class ReportWarning:
    """A notice for users: `kind` is bad, warn or info."""

    kind: str
    code: str
    title: str
    message: str
    sensor: str | None
    t_s: float | None


@dataclass(frozen=True)
class StrideRow:
    """A stride of the list; `excluded` is the reason for exclusion in words."""

    side: Side
    start_s: float
    tc_s: float | None
    end_s: float
    used: bool
    excluded: str | None


@dataclass(frozen=True)
class PreviousVisit:
    """The previous visit, with which the table is compared."""

    session_id: str
    performed_on: dt.date


@dataclass(frozen=True, eq=False)
class ReportModel:
    """Content of the session pages.

    Parameters
    ----------
    problem : error that stopped the analysis, None if complete.
    estimator : pose estimator and its health, None if not reached.
    limits : values against limits, None without included strides.
    profile : distance of the curves from healthy adults, None without curves.
    groups : parameter rows under their headings. key_curve : the panel shown on the overview.
    norm_note : source, size and speed of the reference group, or why there is none.
    curve_notes : explanations of the curves: zero, offsets, confidence, elements.
    since : the visit that `change` of the rows refers to, None without a comparable earlier one.
    condition : walking condition, in words.
    squats : of squats, otherwise None. functional : of a functional test, likewise.
    daily : of a daily-life recording, otherwise None.
    headline : findings and changes, in sentences; None if there is no walk.
    """

    problem: str | None
    quality: QualityBox
    warnings: tuple[ReportWarning, ...]
    kpis: tuple[KeyNumber, ...]
    groups: tuple[tuple[str, tuple[ParameterRow, ...]], ...]
    panels: tuple[CurvePanel, ...]
    strides: tuple[StrideRow, ...]
    duration_s: float
    norm_note: str
    norm_source: str | None
    curve_notes: tuple[str, ...]
    angle_zero: str | None
    zero_offset_deg: Mapping[str, float]
    provenance: Mapping[str, object]
    estimator: EstimatorView | None = None
    profile: ProfileView | None = None
    limits: LimitsView | None = None
    since: PreviousVisit | None = None
    condition: str = ""
    squats: SquatView | None = None
    headline: Headline | None = None
    functional: FunctionalView | None = None
    daily: DailyLifeView | None = None

    @property
    def key_curve(self) -> CurvePanel:
        """Panel of knee flexion."""
        return next(p for p in self.panels if p.variable.name == KEY_CURVE)

    @property
    def page_groups(self) -> tuple[tuple[str, tuple[ParameterRow, ...]], ...]:
        """The groups for a page: every joint angle once, with the zero of its curve."""
        rows = (row for _, group in self.groups for row in group)
        return group_rows(choose_zero(rows, _list_anatomical(self.panels)))

    @property
    def has_sides(self) -> bool:
        """Whether the table has columns for left and right; only a test may lack values of one side."""
        rows = [row for _, group in self.groups for row in group]
        return self.functional is None or any(row.left or row.right for row in rows)

    @property
    def at_speed(self) -> bool:
        """Whether bands are norms at the patient's speed, with lines for norms at comfortable speed."""
        return any(p.comfortable is not None for p in self.panels)

    @property
    def used(self) -> dict[Side, int]:
        """Number of included strides, by side."""
        return {side: sum(s.used for s in self.strides if s.side == side) for side in SIDES}

    @property
    def replay(self) -> dict[str, object]:
        """Data for the page's clock: duration, strides, mean curves by variable and side (deg).

        For squats these replace strides.
        """
        if self.squats is not None:
            means = self.squats.means_deg
            return {
                "duration_s": self.duration_s,
                "called": "squat",
                "strides": [asdict(span) for span in self.squats.spans],
                "curves": {
                    name: {side: round_curve(mean) for side, mean in by_side.items()}
                    for name, by_side in means.items()
                },
            }
        return {
            "duration_s": self.duration_s,
            "strides": [
                {"side": s.side, "start_s": s.start_s, "end_s": s.end_s, "used": s.used} for s in self.strides
            ],
            "curves": {
                p.variable.name: {side: round_curve(c.mean_deg) for side, c in p.sides.items()}
                for p in self.panels
            },
        }

    def to_json(self) -> dict[str, object]:
        """JSON types, without single strides (see curves.csv and angles.parquet)."""
        result = reduce_to_plain(
            {
                "problem": self.problem,
                "quality": self.quality,
                "warnings": self.warnings,
                "key_numbers": self.kpis,
                "parameters": [row for _, rows in self.groups for row in rows],
                "curves": [panel_json(p) for p in self.panels],
                "strides": self.strides,
                "duration_s": self.duration_s,
                "norm_note": self.norm_note,
                "curve_notes": self.curve_notes,
                "angle_zero": self.angle_zero,
                "zero_offset_deg": self.zero_offset_deg,
                "estimator": self.estimator,
                "profile": None if self.profile is None else profile_json(self.profile),
                "limits": self.limits,
                "since": self.since,
                "condition": self.condition,
                "squats": None if self.squats is None else self.squats.to_json(),
                "functional": self.functional,
                "headline": self.headline,
                "daily": None if self.daily is None else self.daily.to_json(),
                "provenance": self.provenance,
            }
        )
        return result if isinstance(result, dict) else {}


def report_model(
    bundle: Bundle,
    *,
    age: float | None = None,
    sex: Sex | None = None,
    speed_mps: float | None = None,
    height_m: float | None = None,
    affected: Side | None = None,
    controls: ControlGroup | None = None,
    treadmill: bool = False,
) -> ReportModel:
    """Build the report of a finished analysis.

    Parameters
    ----------
    age : years at the visit; if missing, curves are compared with all adults, and timing is not compared.
    speed_mps : gait speed, None = from the trial. treadmill : walked on a treadmill.
    height_m : used for dimensionless speed, so that norms match any leg length.
    affected : side, None = none or both. controls : the clinic's own, used if no published norm applies.
    """
    if speed_mps is None:
        speed_mps = next((p.mean for p in bundle.parameters if p.name == "gait_speed_mps"), None)
    contacts_s = bundle.events.contact_uncertainty_s
    norms = look_up_norms(age, sex, speed_mps, height_m, treadmill=treadmill, contacts_s=contacts_s)
    own = None if controls is None else controls.norms(speed_mps, height_m)
    if own is not None:
        norms = _add_own_norms(norms, own)
    rows = parameter_rows(_mark_unsure(bundle), norms, affected)
    curves = None if bundle.angles is None else cycle_curves(bundle.angles, bundle.strides)
    panels = curve_panels(bundle, curves, norms, own)
    standing = {} if bundle.angles is None else bundle.angles.standing_deg
    if curves is not None and standing:
        level = look_up_norms(age, sex, speed_mps, height_m, anatomical_variables(standing))
        rows += level_rows(curves, standing, level, list_estimated_variables(bundle.estimator))
    quality = quality_box(bundle)
    flags = _judge_limits(bundle, curves, height_m, age, own)
    return ReportModel(
        problem=_find_problem(bundle),
        quality=quality,
        warnings=tuple(_warning(n) for n in bundle.warnings),
        kpis=choose_key_numbers(rows),
        groups=group_rows(rows),
        panels=panels,
        strides=tuple(_stride_row(s) for s in bundle.strides.strides),
        duration_s=_duration(bundle),
        norm_note=_norm_note(bundle) or norm_note(rows, panels, norms, controls),
        norm_source=next((p.norm.source for p in panels if p.norm is not None), None),
        curve_notes=curve_notes(bundle, panels),
        angle_zero=None if bundle.angles is None else bundle.angles.zero,
        zero_offset_deg=_zero_offsets(bundle),
        provenance=bundle.provenance,
        estimator=estimator_view(bundle.estimator),
        squats=squat_view(bundle),
        functional=functional_view(bundle, age, sex),
        limits=limits_view(flags) if flags else None,
        headline=_headline(bundle, quality, choose_zero(rows, _list_anatomical(panels)), norms, flags),
        daily=daily_life_view(bundle.activity),
        profile=None if curves is None else _profile(bundle, curves, age, norms),
    )


def _add_own_norms(norms: Norms, own: Norms) -> Norms:
    """Add the clinic's own norms where no published one applies."""
    compared = {name: v for name, v in norms.values.items() if v.comparable or name not in own.values}
    return replace(norms, values={**own.values, **compared})


def _find_problem(bundle: Bundle) -> str | None:
    """Error that stopped the analysis, in words."""
    stopped = next((n.message for n in bundle.warnings if n.severity == "error"), None)
    return None if stopped is None else speak_places(stopped)


def _zero_offsets(bundle: Bundle) -> dict[str, float]:
    """Offsets subtracted from all available angles, in degrees."""
    angles = bundle.angles
    if angles is None:
        return {}
    return {k: float(np.degrees(v)) for k, v in angles.zero_offset.items() if k in angles.angles}


def _is_told_by_trunk(bundle: Bundle) -> bool:
    """Whether this is a functional test without a sensor suitable for strides."""
    return bundle.functional is not None and not bundle.strides.strides


def _mark_unsure(bundle: Bundle) -> tuple[Parameter, ...]:
    """Mark parameters that are estimated by a leg model or uncertain in squats."""
    marked = mark_estimated(bundle.parameters, list_estimated_angles(bundle.estimator))
    return tuple(replace(p, estimated=True) if p.name.startswith(UNSURE_FIGURES) else p for p in marked)


def _stride_row(s: Stride) -> StrideRow:
    reason = None if s.excluded_reason is None else explain_exclusion(s.excluded_reason)
    return StrideRow(s.side, s.start_s, s.tc_s, s.end_s, s.excluded_reason is None, reason)


def _profile(bundle: Bundle, curves: CycleCurves, age: float | None, norms: Norms) -> ProfileView | None:
    """Scores against all adults of this age, and against those at this speed if available."""
    matched = adult_reference_at_speed(age, norms.speed)
    at_speed = None if matched is None else _scores(bundle, curves, age, matched)
    return profile_view(_scores(bundle, curves, age), at_speed)


def _list_anatomical(panels: Sequence[CurvePanel]) -> set[str]:
    return {p.variable.name for p in panels if p.zero == "anatomical"}


def _scores(
    bundle: Bundle, curves: CycleCurves, age: float | None, reference: CurveReference | None = None
) -> Scores:
    standing = {} if bundle.angles is None else bundle.angles.standing_deg
    unsure = list_estimated_variables(bundle.estimator)
    return score_curves(curves, standing, reference, estimated=unsure, age=age)


def _judge_limits(
    bundle: Bundle,
    curves: CycleCurves | None,
    height_m: float | None,
    age: float | None,
    own: Norms | None,
) -> tuple[Flag, ...]:
    """Compare values with limits, empty without included strides. Estimated angles are excluded."""
    if not bundle.strides.select_used():
        return ()
    unsure = list_estimated_variables(bundle.estimator)
    if curves is not None:
        measured = {v: c for v, c in curves.curves.items() if v not in unsure}
        curves = replace(curves, curves=measured)
    standing = {} if bundle.angles is None else bundle.angles.standing_deg
    return judge_flags(curves, bundle.parameters, standing, height_m, own, age)


def _headline(
    bundle: Bundle,
    quality: QualityBox,
    rows: Sequence[ParameterRow],
    norms: Norms,
    flags: Sequence[Flag],
) -> Headline | None:
    """Headline; only the badge for poor data, None without a walk."""
    if bundle.repetitions is not None or bundle.activity is not None or _is_told_by_trunk(bundle):
        return None
    badge = say_badge(quality.kind, bundle.strides)
    if quality.kind == "bad":
        return Headline(badge)
    standouts, looked_at = find_standouts(rows, norms, flags)
    return Headline(badge, standouts, looked_at=looked_at)


def _duration(bundle: Bundle) -> float:
    if bundle.angles is not None and len(bundle.angles.t_s):
        return float(bundle.angles.t_s[-1])
    return float(bundle.quality.get("duration_s") or 0.0)


def _norm_note(bundle: Bundle) -> str | None:
    """Note for movements without a norm, None for walking."""
    if _is_told_by_trunk(bundle):
        return TEST_NORM_NOTE
    if bundle.activity is not None:
        return "Daily life is not compared with a norm."
    return NORM_NOTE if bundle.repetitions is not None else None


def _warning(n: Notice) -> ReportWarning:
    title = title_of_code(n.code)
    location = "" if n.sensor is None else f", {place_words(n.sensor)}"
    return ReportWarning(
        kind=_KINDS[n.severity],
        code=n.code,
        title=f"{title}{location}",
        message=speak_places(n.message),
        sensor=n.sensor,
        t_s=n.t_s,
    )
