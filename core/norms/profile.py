"""Distance of gait curves from a reference: gait variable score and gait profile score.

Baker et al. 2009 (Gait & Posture 30:265) and 2012: a GVS is the RMS over the cycle of one curve minus its
reference, the GPS of a side the RMS of its nine, the overall GPS the RMS of fifteen, the pelvis once, left by
convention (docs/science/norms-and-scores.md, "GVS and GPS"). RMS everywhere: averaging the GVS, or padding a
side with zeros, gives less.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from core.frames import SIDES, Floats, Side

PELVIS: Final = ("pelvis_tilt", "pelvis_obliquity", "pelvis_rotation")
NINE: Final = (
    *PELVIS, "hip_flexion", "hip_adduction", "hip_rotation", "knee_flexion", "ankle_dorsiflexion",
    "foot_progression",
)  # fmt: skip
"""Variables of the GPS."""

SAGITTAL: Final = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")
"""Variables of `gps_sagittal`, which is never called GPS: it has three of nine variables."""

Profile = Literal["gps", "gps_sagittal"]
PROFILES: Final[Mapping[Profile, tuple[str, ...]]] = {"gps": NINE, "gps_sagittal": SAGITTAL}

Mode = Literal["raw", "offset_removed"]
MODES: Final[tuple[Mode, ...]] = ("raw", "offset_removed")
"""As measured, or with the mean over the cycle taken from curve and reference: shape without level."""

MeanCurves = Mapping[Side, Mapping[str, Floats]]
"""Mean curves of one person, side → variable → (101,) degrees."""


@dataclass(frozen=True)
class ScoreSpread:
    """How a score, in degrees, is spread among healthy people; the ln figures serve GDI*."""

    mean_deg: float
    sd_deg: float
    median_deg: float
    p75_deg: float
    p95_deg: float
    mean_ln: float | None
    sd_ln: float | None


@dataclass(frozen=True, eq=False)
class CurveReference:
    """What curves are scored against.

    Parameters
    ----------
    mean_deg : variable → (101,).
    spreads : mode → variable, or profile and "_side" or "_overall" → the people themselves, leave one out.
    zero : what the angles are measured from; raw scores need curves with the same zero.
    n, group, source : people, who, from where; printed beside every score.
    speed_matched : they walked at the person's speed, else at their own.
    """

    mean_deg: Mapping[str, Floats]
    spreads: Mapping[Mode, Mapping[str, ScoreSpread]]
    zero: Literal["anatomical", "standing"]
    n: int
    group: str
    source: str
    speed_matched: bool = False


def gvs(curve: Floats, reference: Floats, mode: Mode) -> Floats:
    """Gait variable score of curves (..., 101) against one (101,): RMS over the cycle, same unit."""
    difference = curve - reference
    if mode == "offset_removed":
        difference = difference - difference.mean(axis=-1, keepdims=True)
    return np.asarray(np.sqrt(np.mean(difference**2, axis=-1)))


def side_profile(scores: Mapping[str, float], variables: Sequence[str]) -> float | None:
    """RMS of the GVS of one side, None unless all `variables` are there."""
    if any(v not in scores for v in variables):
        return None
    return _rms([scores[v] for v in variables])


def overall_profile(scores: Mapping[Side, Mapping[str, float]], variables: Sequence[str]) -> float | None:
    """RMS of the GVS of both sides with the left pelvis only, None unless all are there."""
    left, right = scores.get("left", {}), scores.get("right", {})
    rest = [v for v in variables if v not in PELVIS]
    if any(v not in left for v in variables) or any(v not in right for v in rest):
        return None
    return _rms([left[v] for v in variables] + [right[v] for v in rest])


def person_mean(curves: MeanCurves, variable: str) -> Floats | None:
    """Mean curve (101,) of a person's sides, of the one there is, or None."""
    found = [curves[side][variable] for side in SIDES if variable in curves.get(side, {})]
    return np.mean(found, axis=0) if found else None


def leave_one_out(people: Sequence[MeanCurves]) -> dict[Mode, dict[str, ScoreSpread]]:
    """Scores of healthy people, each against the mean of the others; a score of fewer than two is left out.

    A side counts by itself; percentiles are linear between order statistics, sd with n − 1.
    """
    own = [{v: m for v in NINE if (m := person_mean(p, v)) is not None} for p in people]
    means = {v: [m[v] for m in own if v in m] for v in NINE}
    totals = {v: (np.sum(rows, axis=0), len(rows)) for v, rows in means.items() if len(rows) > 1}
    others = [{v: (t - m[v]) / (n - 1) for v, (t, n) in totals.items() if v in m} for m in own]
    spreads: dict[Mode, dict[str, ScoreSpread]] = {}
    for mode in MODES:
        values: dict[str, list[float]] = {}
        for person, rest in zip(people, others, strict=True):
            found: dict[Side, dict[str, float]] = {}
            for variable, reference in rest.items():
                for side in SIDES:
                    if variable in person.get(side, {}):
                        score = float(gvs(person[side][variable], reference, mode))
                        found.setdefault(side, {})[variable] = score
                        values.setdefault(variable, []).append(score)
            for name, variables in PROFILES.items():
                for side in SIDES:
                    _append(values, f"{name}_side", side_profile(found.get(side, {}), variables))
                _append(values, f"{name}_overall", overall_profile(found, variables))
        spreads[mode] = {name: _spread(np.array(v)) for name, v in values.items() if len(v) > 1}
    return spreads


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _append(values: dict[str, list[float]], name: str, value: float | None) -> None:
    if value is not None:
        values.setdefault(name, []).append(value)


def _spread(x: Floats) -> ScoreSpread:
    median, p75, p95 = np.percentile(x, (50, 75, 95)).tolist()
    # two people with the very same curves score 0, which has no logarithm
    ln = np.log(x) if (x > 0).all() else None
    return ScoreSpread(
        mean_deg=float(x.mean()),
        sd_deg=float(x.std(ddof=1)),
        median_deg=median,
        p75_deg=p75,
        p95_deg=p95,
        mean_ln=None if ln is None else float(ln.mean()),
        sd_ln=None if ln is None else float(ln.std(ddof=1)),
    )
