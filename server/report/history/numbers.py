"""Results of an analysis without its signals, for summaries over many visits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np

from sagittal.core.errors import Notice
from sagittal.core.frames import Side
from sagittal.core.norms.controls import mean_curves
from sagittal.core.norms.profile import MeanCurves, ScoreSpread
from sagittal.core.norms.scores import Score, score_curves
from sagittal.core.parameters import cycle_curves
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.uncertainty import mark_estimated
from sagittal.server.report.files.bundle import Bundle, keep_told
from sagittal.server.report.view.quality_box import data_verdict
from sagittal.server.report.words.estimator import list_estimated_angles, list_estimated_variables


@dataclass(frozen=True)
class Numbers:
    """Parameters, scores over several curves, and data quality (symbol and word).

    Parameters
    ----------
    contacts_s : uncertainty of contacts, s; None if unknown.
    """

    parameters: tuple[Parameter, ...]
    scores: tuple[Score, ...]
    verdict: tuple[str, str]
    contacts_s: float | None = None


@dataclass(frozen=True, eq=False)
class WalkMeans:
    """Contribution of a control's walk to a reference: parameters, and mean curves relative to
    standing, deg.
    """

    parameters: tuple[Parameter, ...]
    curves: MeanCurves


class _StoredParameters(msgspec.Struct):
    """Parameter-related content of analysis.json."""

    parameters: tuple[Parameter, ...]
    estimator: dict[str, Any] | None = None

    def mark(self) -> tuple[Parameter, ...]:
        """Mark estimated parameters, since files of earlier versions mark only angles."""
        return mark_estimated(self.parameters, list_estimated_angles(self.estimator))


class _StoredMeans(_StoredParameters):
    mean_curves: dict[Side, dict[str, list[float | None]]] | None = None


class _StoredNumbers(_StoredParameters, kw_only=True):
    quality: dict[str, Any]
    warnings: tuple[Notice, ...]
    walking: dict[str, Any] | None = None
    scores: list[dict[str, Any]] | None = None


_read_means = msgspec.json.Decoder(_StoredMeans).decode
_read_numbers = msgspec.json.Decoder(_StoredNumbers).decode


def read_means(content: bytes) -> WalkMeans | None:
    """Means from analysis.json; None if written by a version without mean curves."""
    stored = _read_means(content)
    if stored.mean_curves is None:
        return None
    curves = {
        side: {v: np.array(c, np.float64) for v, c in own.items()} for side, own in stored.mean_curves.items()
    }
    return WalkMeans(stored.mark(), curves)


def means_of(bundle: Bundle) -> WalkMeans:
    """Means of an analysis that was loaded with its curves."""
    parameters = mark_estimated(bundle.parameters, list_estimated_angles(bundle.estimator))
    if bundle.angles is None:
        return WalkMeans(parameters, {})
    curves = cycle_curves(bundle.angles, bundle.strides)
    return WalkMeans(parameters, mean_curves(curves, list_estimated_variables(bundle.estimator)))


def read_numbers(content: bytes) -> Numbers | None:
    """Results from analysis.json; None if written by a version without scores."""
    stored = _read_numbers(content)
    if stored.scores is None:
        return None
    parameters = stored.mark()
    severities = {n.severity for n in keep_told(stored.warnings)}
    verdict = data_verdict(stored.quality, stored.estimator, severities, parameters)
    contacts_s = (stored.walking or {}).get("contact_uncertainty_s")
    return Numbers(parameters, tuple(_score(row) for row in stored.scores), verdict, contacts_s)


def numbers_of(bundle: Bundle) -> Numbers:
    """Results of an analysis that was loaded with its curves."""
    unsure = list_estimated_variables(bundle.estimator)
    parameters = mark_estimated(bundle.parameters, list_estimated_angles(bundle.estimator))
    verdict = data_verdict(
        bundle.quality, bundle.estimator, {n.severity for n in bundle.warnings}, bundle.parameters
    )
    contacts_s = bundle.events.contact_uncertainty_s
    if bundle.angles is None:
        return Numbers(parameters, (), verdict, contacts_s)
    curves = cycle_curves(bundle.angles, bundle.strides)
    curve_scores = score_curves(curves, bundle.angles.standing_deg, estimated=unsure)
    scores = tuple(s for s in curve_scores.scores if s.variable is None)
    return Numbers(parameters, scores, verdict, contacts_s)


def _score(row: Mapping[str, Any]) -> Score:
    healthy = row["healthy"]
    fields = {**row, "healthy": None if healthy is None else ScoreSpread(**healthy)}
    return Score(variable=None, **{**fields, "missing": tuple(row["missing"])})
