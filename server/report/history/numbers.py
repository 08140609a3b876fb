"""The numbers of a finished analysis without its signals: what a look over many visits reads."""

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
    """Parameters, the scores over several curves, and the verdict on the data (its shape and word).

    Parameters
    ----------
    contacts_s : what the contacts are known to, s; None where nothing says so.
    """

    parameters: tuple[Parameter, ...]
    scores: tuple[Score, ...]
    verdict: tuple[str, str]
    contacts_s: float | None = None


@dataclass(frozen=True, eq=False)
class WalkMeans:
    """What a control's walk gives to a reference: parameters, and mean curves in degrees from standing."""

    parameters: tuple[Parameter, ...]
    curves: MeanCurves


class _StoredParameters(msgspec.Struct):
    """What of analysis.json says which parameters there are; all else is passed over."""

    parameters: tuple[Parameter, ...]
    estimator: dict[str, Any] | None = None

    def mark(self) -> tuple[Parameter, ...]:
        """Mark what is estimated: files of earlier versions say so only of the angles."""
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
    """The means in analysis.json; None if it is of a version that wrote no mean curves."""
    stored = _read_means(content)
    if stored.mean_curves is None:
        return None
    curves = {
        side: {v: np.array(c, np.float64) for v, c in own.items()} for side, own in stored.mean_curves.items()
    }
    return WalkMeans(stored.mark(), curves)


def means_of(bundle: Bundle) -> WalkMeans:
    """The means of an analysis that was read with its curves."""
    parameters = mark_estimated(bundle.parameters, list_estimated_angles(bundle.estimator))
    if bundle.angles is None:
        return WalkMeans(parameters, {})
    curves = cycle_curves(bundle.angles, bundle.strides)
    return WalkMeans(parameters, mean_curves(curves, list_estimated_variables(bundle.estimator)))


def read_numbers(content: bytes) -> Numbers | None:
    """The numbers in analysis.json; None if it is of a version that wrote no scores."""
    stored = _read_numbers(content)
    if stored.scores is None:
        return None
    parameters = stored.mark()
    severities = {n.severity for n in keep_told(stored.warnings)}
    judged = data_verdict(stored.quality, stored.estimator, severities, parameters)
    contacts_s = (stored.walking or {}).get("contact_uncertainty_s")
    return Numbers(parameters, tuple(_score(row) for row in stored.scores), judged, contacts_s)


def numbers_of(bundle: Bundle) -> Numbers:
    """The numbers of an analysis that was read with its curves."""
    unsure = list_estimated_variables(bundle.estimator)
    parameters = mark_estimated(bundle.parameters, list_estimated_angles(bundle.estimator))
    judged = data_verdict(
        bundle.quality, bundle.estimator, {n.severity for n in bundle.warnings}, bundle.parameters
    )
    contacts_s = bundle.events.contact_uncertainty_s
    if bundle.angles is None:
        return Numbers(parameters, (), judged, contacts_s)
    curves = cycle_curves(bundle.angles, bundle.strides)
    found = score_curves(curves, bundle.angles.standing_deg, estimated=unsure)
    scores = tuple(s for s in found.scores if s.variable is None)
    return Numbers(parameters, scores, judged, contacts_s)


def _score(row: Mapping[str, Any]) -> Score:
    healthy = row["healthy"]
    known = {**row, "healthy": None if healthy is None else ScoreSpread(**healthy)}
    return Score(variable=None, **{**known, "missing": tuple(row["missing"])})
