"""CSV equivalents of the pages: parameters, cycle curves, trends, strides with feedback."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite

from sagittal.core.change import Change
from sagittal.core.events.result import COMPARED
from sagittal.core.feedback.summary import classify_stride
from sagittal.core.parameters.catalogue import unit_of
from sagittal.core.parameters.kinematic import AT_BOUND, POINTS
from sagittal.server.report.files.columns import write_csv
from sagittal.server.report.history.trends import AnalysedVisit, Trend
from sagittal.server.report.view.feedback import FeedbackView
from sagittal.server.report.view.model import ReportModel

SYMMETRY = {
    "ratio": "ratio_left_right",
    "index_pct": "symmetry_index_pct",
    "angle_pct": "symmetry_angle_pct",
}
"""Attribute of the symmetry (core/parameters/symmetry.py) → its column."""


def parameters_csv(report: ReportModel) -> bytes:
    """One row per parameter and side: unrounded value or reason for its absence, and comparable norm."""
    header = (
        "name",
        "side",
        "n",
        "mean",
        "sd",
        "uncertainty",
        "unit",
        "difference",
        *SYMMETRY.values(),
        "norm_mean",
        "norm_sd",
        "norm_source",
        "norm_group",
        "comfortable_mean",
        "comfortable_sd",
        "reason",
        "condition",
    )

    def rows() -> Iterator[Sequence[object]]:
        for _, group in report.groups:
            for r in group:
                cells = (("", r.both),) if r.whole else (("left", r.left), ("right", r.right))
                for side, c in cells:
                    numbers = (0, None, None, None) if c is None else (c.n, c.value, c.sd, c.uncertainty)
                    norm = (r.norm_mean, r.norm_sd, r.norm_source, r.norm_group)
                    usual = (r.comfortable_mean, r.comfortable_sd)
                    if c is not None and c.few:
                        norm, usual = (None, None, None, None), (None, None)
                    yield (
                        r.name,
                        side,
                        *numbers,
                        r.unit,
                        r.difference,
                        *(
                            None if r.symmetry is None else getattr(r.symmetry, index_name)
                            for index_name in SYMMETRY
                        ),
                        *norm,
                        *usual,
                        (r.reason or r.side_reason) if c is None else None,
                        report.condition,
                    )

    return write_csv(header, rows())


def trends_csv(visits: Sequence[AnalysedVisit], trends: Sequence[Trend]) -> bytes:
    """One row per parameter, side and visit, with the change since the first assessment and its limits."""
    header = (
        *("name", "side", "unit", "date", "session_id", "visit", "kind"),
        *("n", "mean", "sd", "ci_low", "ci_high", "estimated"),
        *("change", "verdict", "mdc", "mdc_source", "mcid", "mcid_source", "reason", "condition"),
    )

    def rows() -> Iterator[Sequence[object]]:
        for trend in trends:
            for line in trend.lines:
                for p in line.points:
                    v, c = visits[p.visit], p.change
                    yield (
                        *(trend.name, line.side or "", trend.term.unit),
                        *(v.performed_on.isoformat(), v.session_id, v.label or "", v.kind),
                        *(p.n, p.value, p.sd, p.ci_low, p.ci_high, int(p.estimated)),
                        *((None,) * 7 if c is None else _judged(c)),
                        v.condition.words,
                    )

    return write_csv(header, rows())


def _judged(c: Change) -> tuple[object, ...]:
    return (c.difference, c.verdict, c.limit, c.limit_source, c.mcid, c.mcid_source, c.reason)


def curves_csv(report: ReportModel) -> bytes:
    """One row per variable, side and % of cycle: mean and sd of the included strides, matching norm.

    The mean is empty, with a `reason`, where the knee of the leg model is at its limit in most strides.
    """
    header = (
        "variable",
        "side",
        "pct_cycle",
        "n",
        "mean_deg",
        "sd_deg",
        "norm_mean_deg",
        "norm_sd_deg",
        "norm_group",
        "comfortable_mean_deg",
        "comfortable_sd_deg",
        "zero",
        "reason",
    )

    def rows() -> Iterator[Sequence[object]]:
        for p in report.panels:
            for side, c in p.sides.items():
                if c.mean_deg is None:
                    continue
                norm, usual = (p.norm, p.comfortable) if c.n >= COMPARED else (None, None)
                for i in range(POINTS):
                    yield (
                        p.variable.name,
                        side,
                        i,
                        c.n,
                        float(c.mean_deg[i]),
                        None if c.sd_deg is None else float(c.sd_deg[i]),
                        None if norm is None else float(norm.mean_deg[i]),
                        None if norm is None else float(norm.sd_deg[i]),
                        None if norm is None else norm.group,
                        None if usual is None else float(usual.mean_deg[i]),
                        None if usual is None else float(usual.sd_deg[i]),
                        p.zero,
                        None if isfinite(c.mean_deg[i]) else AT_BOUND,
                    )

    return write_csv(header, rows())


def feedback_csv(view: FeedbackView | None) -> bytes:
    """One row per stride of a live trial with its cue, unrounded; without feedback only the header."""
    header = (
        *("n", "side", "start_s", "parameter", "value", "live_value", "unit", "kind", "shown", "why_not"),
        *("in_zone", "level", "zone_low", "zone_high", "probe_block"),
    )

    def cells() -> Iterator[Sequence[object]]:
        for m in () if view is None else view.split.strides:
            c, name = m.cue, "" if view is None else view.content.parameter
            yield (
                *(c.n, c.side, c.start_s, name, m.value, c.value, unit_of(name), classify_stride(c), c.shown),
                *(c.why_not, m.inside, c.level, c.zone_low, c.zone_high, c.block),
            )

    return write_csv(header, cells())
