"""Cycle curves as they are drawn and tabled: degrees, left and right, the norm where comparable."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from core.frames import SIDES, Floats, Side
from core.norms import NormBand
from core.norms.lookup import Norms
from core.parameters import mean_curve
from core.parameters.kinematic import MEAN_ZERO
from core.parameters.result import CycleCurves
from server.report.bundle import Bundle
from server.report.estimator import estimated_variables
from server.report.wording import VARIABLES, ZERO_WORDS, Variable, reason_words

DRAWN_STRIDES: Final = 40
"""Single strides drawn per side at most, spread over the take; more only make the page heavy."""


@dataclass(frozen=True, eq=False)
class SideCurve:
    """One side of one variable.

    Parameters
    ----------
    mean_deg, sd_deg : (101,) over the counted strides; None without strides, sd also with one.
    n : strides behind the mean. strides : index in the stride list → (101,) deg, counted strides to draw.
    foot_off_pct, foot_off_sd : terminal contact, % of cycle, None if not found.
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
    title : with the zero in words, "Knee flexion, from standing".
    low_confidence : frontal and transverse planes, and joints without a sensor on both of their segments.
    reason : why there is no curve, None if there is one.
    norm : band to draw, None where it is not comparable. norm_note : what must be said about it.
    """

    variable: Variable
    title: str
    low_confidence: bool
    reason: str | None
    norm: NormBand | None
    norm_note: str
    sides: Mapping[Side, SideCurve]


def curve_panels(bundle: Bundle, curves: CycleCurves | None, norms: Norms) -> tuple[CurvePanel, ...]:
    """All panels in reading order; a variable without a curve keeps its place and says why.

    Parameters
    ----------
    curves : of the bundle's angles over its strides, None without angles.
    """
    zero = None if bundle.angles is None else bundle.angles.zero
    estimated = estimated_variables(bundle.estimator)
    return tuple(
        _panel(v, curves, zero, norms.bands.get(v.name), sure=v.name not in estimated) for v in VARIABLES
    )


def _panel(
    variable: Variable, curves: CycleCurves | None, zero: str | None, band: NormBand | None, *, sure: bool
) -> CurvePanel:
    sides = {} if curves is None else {s: _side(curves, variable.name, s) for s in SIDES}
    sides = {s: c for s, c in sides.items() if c.mean_deg is not None}
    reason = None if sides else _why_missing(variable, curves)
    if variable.name in MEAN_ZERO:
        zero = "stride_mean"
    words = "" if zero is None else ZERO_WORDS.get(zero, zero)
    return CurvePanel(
        variable=variable,
        title=f"{variable.label}, {words}" if words else variable.label,
        low_confidence=variable.plane != "sagittal" or not sure,
        reason=reason,
        norm=band if band is not None and band.comparable and reason is None else None,
        norm_note="" if band is None else band.note,
        sides=sides,
    )


def _why_missing(variable: Variable, curves: CycleCurves | None) -> str:
    if curves is None:
        return reason_words("not_reached")
    return reason_words("no_strides" if variable.name in curves.curves else "joint_missing")


def _side(curves: CycleCurves, name: str, side: Side) -> SideCurve:
    mean = mean_curve(curves, name, side)
    rows = curves.curves.get(name, {}).get(side)
    strides: dict[int, Floats] = {}
    off = np.empty(0)
    if rows is not None and mean.n:
        counted = np.flatnonzero(curves.used[side] & np.isfinite(rows).all(axis=1))
        off = curves.foot_off_pct[side][counted]
        off = off[np.isfinite(off)]
        if len(counted) > DRAWN_STRIDES:
            counted = counted[np.linspace(0, len(counted) - 1, DRAWN_STRIDES).round().astype(np.int64)]
        index = curves.stride_index[side]
        strides = {index[i]: np.degrees(rows[i]) for i in counted}
    return SideCurve(
        mean_deg=None if mean.mean is None else np.degrees(mean.mean),
        sd_deg=None if mean.sd is None else np.degrees(mean.sd),
        n=mean.n,
        strides=strides,
        foot_off_pct=float(off.mean()) if len(off) else None,
        foot_off_sd=float(off.std(ddof=1)) if len(off) > 1 else None,
    )
