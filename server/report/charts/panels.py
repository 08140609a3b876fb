"""Cycle curves for charts and tables: degrees, left and right, with norms where comparable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sagittal.core.events.result import COMPARED
from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.message import Message
from sagittal.core.norms import NormBand
from sagittal.core.norms.kinematics import Zero
from sagittal.core.norms.lookup import Norms
from sagittal.core.parameters import mean_curve
from sagittal.core.parameters.anatomical_zero import anatomical_variables, standing_offset_deg
from sagittal.core.parameters.kinematic import MEAN_ZERO, rest_at_bound
from sagittal.core.parameters.result import CycleCurves
from sagittal.core.parameters.variability import mean_and_sd
from sagittal.server.report.files.bundle import Bundle
from sagittal.server.report.words.estimator import list_estimated_variables
from sagittal.server.report.words.wording import VARIABLES, ZERO_WORDS, Variable, reason_words

NO_BAND: Final[Mapping[Zero, str]] = {
    "standing": "No norm band: these curves are relative to this person's standing, the norm to the "
    "anatomical zero. Enter goniometer angles in standing to compare.",
    "walking": "No norm band: no usable quiet standing, so these curves are relative to their own mean in "
    "walking.",
    "stride_mean": "No norm band: measured relative to its own mean over the stride, unlike the norm.",
    "anatomical": "No norm band: the norm is relative to standing.",
}
"""Zero of a curve → why no known band is shown."""

FEW_BAND: Final = Message(
    "No norm band: at least {COMPARED} strides per side are needed for a comparison.", COMPARED=COMPARED
)
"""The same where no side has enough strides."""

DRAWN_STRIDES: Final = 40
"""Maximum of single strides drawn per side, spread over the trial; more would only enlarge the page."""


@dataclass(frozen=True, eq=False)
class SideCurve:
    """Curve of one side of one variable.

    Parameters
    ----------
    mean_deg, sd_deg : (101,) over the included strides; None without strides, sd also with one. NaN where the
        knee of the leg model is at its limit in most strides.
    n : number of strides in the mean. strides : index in the stride list → (101,) deg, included strides to
        draw, NaN where the knee is at its limit.
    foot_off_pct, foot_off_sd : foot-off, % of cycle, None if not detected.
    """

    mean_deg: Floats | None
    sd_deg: Floats | None
    n: int
    strides: Mapping[int, Floats]
    foot_off_pct: float | None
    foot_off_sd: float | None


@dataclass(frozen=True, eq=False)
class CurvePanel:
    """One chart.

    Parameters
    ----------
    title : including the zero, "Knee flexion, from standing".
    zero : zero of the curves, None without angles. added_deg : goniometer reading added to it, by side; empty
        if relative to standing.
    low_confidence : frontal and transverse planes, and joints without a sensor on both segments.
    reason : why there is no curve, None if there is one.
    norm : band with the same zero; None if there is none. norm_note : remarks on the norm, or why an existing
        norm is not shown.
    comfortable : band of the same group at comfortable speed, if `norm` is at the patient's speed.
    """

    variable: Variable
    title: str
    zero: Zero | None
    added_deg: Mapping[Side, float]
    low_confidence: bool
    reason: str | None
    norm: NormBand | None
    norm_note: str
    sides: Mapping[Side, SideCurve]
    comfortable: NormBand | None = None


def curve_panels(
    bundle: Bundle, curves: CycleCurves | None, norms: Norms, own: Norms | None = None
) -> tuple[CurvePanel, ...]:
    """All panels in display order; a variable without a curve keeps its place with a reason.

    Curves are anatomical if a goniometer was used on both sides, otherwise relative to standing.

    Parameters
    ----------
    curves : of the bundle's angles over its strides, None without angles.
    norms, own : published reference, and the clinic's own controls; the first with a band of the same zero is
        used, for measured variables only.
    """
    estimated = list_estimated_variables(bundle.estimator)
    standing = {} if bundle.angles is None else bundle.angles.standing_deg
    level = set(anatomical_variables(standing)).difference(estimated)
    band_sets = () if own is None else (own.bands,)
    panels = []
    for v in VARIABLES:
        bands = [b for by_name in (norms.bands, *band_sets) if (b := by_name.get(v.name)) is not None]
        added = {s: standing_offset_deg(v.name, s, standing) for s in SIDES} if v.name in level else {}
        panel = _panel(v, curves, added, bands, sure=v.name not in estimated)
        if panel.norm is not None and panel.norm is norms.bands.get(v.name):
            panel = replace(panel, comfortable=norms.comfortable_bands.get(v.name))
        panels.append(panel)
    return tuple(panels)


def same_zero(earlier: CurvePanel, later: CurvePanel) -> tuple[CurvePanel, CurvePanel]:
    """Convert two panels of a variable to a common zero: relative to standing unless both are anatomical. The
    earlier one loses its curves if only one trial includes quiet standing.
    """
    if earlier.zero == later.zero or None in (earlier.zero, later.zero):
        return earlier, later
    if "walking" in (earlier.zero, later.zero):
        # a curve without an absolute level is not overlaid on one that has one
        return replace(earlier, sides={}, reason=reason_words("no_standing")), later
    return _from_standing(earlier), _from_standing(later)


def _from_standing(panel: CurvePanel) -> CurvePanel:
    if panel.zero != "anatomical":
        return panel
    sides = {s: _moved(c, -panel.added_deg[s]) for s, c in panel.sides.items()}
    return replace(
        panel,
        title=_title(panel.variable, "standing"),
        zero="standing",
        added_deg={},
        norm=None,
        norm_note="",
        sides=sides,
        comfortable=None,
    )


def _panel(
    variable: Variable,
    curves: CycleCurves | None,
    added: Mapping[Side, float],
    bands: Sequence[NormBand],
    *,
    sure: bool,
) -> CurvePanel:
    sides = {} if curves is None else {s: _side(curves, variable.name, s) for s in SIDES}
    sides = {s: c for s, c in sides.items() if c.mean_deg is not None}
    sides = {s: _moved(c, added.get(s, 0.0)) for s, c in sides.items()}
    reason = None if sides else _why_missing(variable, curves)
    zero: Zero | None = None
    if curves is not None:
        zero = "stride_mean" if variable.name in MEAN_ZERO else "anatomical" if added else curves.zero
    fitting = next((b for b in bands if b.zero == zero), None) if sure and reason is None else None
    note = "" if fitting is None else fitting.note
    if fitting is not None and all(c.n < COMPARED for c in sides.values()):
        fitting, note = None, FEW_BAND
    elif fitting is None and bands and sure and zero is not None:
        note = NO_BAND[zero]
    return CurvePanel(
        variable=variable,
        title=_title(variable, zero),
        zero=zero,
        added_deg=added,
        low_confidence=variable.plane != "sagittal" or not sure,
        reason=reason,
        norm=fitting,
        norm_note=note,
        sides=sides,
    )


def _title(variable: Variable, zero: Zero | None) -> str:
    return variable.label if zero is None else f"{variable.label}, {ZERO_WORDS[zero]}"


def _moved(curve: SideCurve, by_deg: float) -> SideCurve:
    """The curve with a shifted zero."""
    if by_deg == 0.0 or curve.mean_deg is None:
        return curve
    strides = {i: row + by_deg for i, row in curve.strides.items()}
    return replace(curve, mean_deg=curve.mean_deg + by_deg, strides=strides)


def _why_missing(variable: Variable, curves: CycleCurves | None) -> str:
    if curves is None:
        return reason_words("not_reached")
    reason = next(iter(curves.why.get(variable.name, {}).values()), None)
    return reason_words(reason or ("no_strides" if variable.name in curves.curves else "joint_missing"))


def _side(curves: CycleCurves, name: str, side: Side) -> SideCurve:
    mean = mean_curve(curves, name, side)
    rows = curves.curves.get(name, {}).get(side)
    strides: dict[int, Floats] = {}
    off = np.empty(0)
    if rows is not None and mean.n:
        included = np.flatnonzero(curves.used[side] & np.isfinite(rows).all(axis=1))
        off = curves.foot_off_pct[side][included]
        off = off[np.isfinite(off)]
        if len(included) > DRAWN_STRIDES:
            included = included[np.linspace(0, len(included) - 1, DRAWN_STRIDES).round().astype(np.int64)]
        drawn, index = rows[included], curves.stride_index[side]
        values = np.where(rest_at_bound(curves, name, side, drawn), np.nan, np.degrees(drawn))
        strides = {index[i]: row for i, row in zip(included, values, strict=True)}
    foot_off, foot_off_sd = mean_and_sd(off) if len(off) else (None, None)
    return SideCurve(
        mean_deg=None if mean.mean is None else np.degrees(mean.mean),
        sd_deg=None if mean.sd is None else np.degrees(mean.sd),
        n=mean.n,
        strides=strides,
        foot_off_pct=foot_off,
        foot_off_sd=foot_off_sd,
    )
