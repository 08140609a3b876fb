"""JSON of a report's curves and profile for the API: renamed fields, degrees rounded to 0.01, no drawings."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from sagittal.core.frames import Floats
from sagittal.core.norms.kinematics import NormBand
from sagittal.server.report.charts.panels import CurvePanel, SideCurve
from sagittal.server.report.view.profile import ProfileView


def round_curve(values: Floats | None) -> list[float | None] | None:
    """A curve rounded to 0.01°; None where it has no value."""
    if values is None:
        return None
    return [x if np.isfinite(x) else None for x in np.round(values, 2).tolist()]


def profile_json(profile: ProfileView) -> dict[str, object]:
    """The profile without its drawings."""
    rows = [{k: v for k, v in asdict(row).items() if k != "svg"} for row in profile.rows]
    return {"rows": rows, "index": profile.index, "note": profile.note, "at_speed": profile.at_speed}


def panel_json(p: CurvePanel) -> dict[str, object]:
    """A panel of curves, with the relevant attributes of its variable."""
    v = p.variable
    return {
        "variable": v.name,
        "title": p.title,
        "plane": v.plane,
        "zero": p.zero,
        "low_confidence": p.low_confidence,
        "reason": p.reason,
        "y_range_deg": v.y_range,
        "up": v.up,
        "down": v.down,
        "norm": _band_json(p.norm),
        "comfortable": _band_json(p.comfortable),
        "norm_note": p.norm_note,
        "sides": {side: _side_json(c) for side, c in p.sides.items()},
    }


def _band_json(band: NormBand | None) -> dict[str, object] | None:
    if band is None:
        return None
    return {
        "mean_deg": round_curve(band.mean_deg),
        "sd_deg": round_curve(band.sd_deg),
        "n": band.n,
        "group": band.group,
        "source": band.source,
    }


def _side_json(c: SideCurve) -> dict[str, object]:
    return {
        "n": c.n,
        "mean_deg": round_curve(c.mean_deg),
        "sd_deg": round_curve(c.sd_deg),
        "foot_off_pct": c.foot_off_pct,
        "foot_off_sd": c.foot_off_sd,
    }
