"""Distance of gait curves from a reference: gait variable score and gait profile score.

Baker et al. 2009 (Gait & Posture 30:265) and 2012: a GVS is the RMS over the cycle of one curve minus its
reference, the GPS of a side the RMS of its nine, the overall GPS the RMS of fifteen, the pelvis once, left by
convention (docs/science/norms-and-scores.md, "GVS and GPS"). RMS throughout: averaging the GVS, or padding a
side with zeros, would give smaller values.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from sagittal.core.frames import SIDES, Bools, Floats, Side

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
    """Distribution of a score, in degrees, among healthy people; the ln values are for GDI*."""

    mean_deg: float
    sd_deg: float
    median_deg: float
    p75_deg: float
    p95_deg: float
    mean_ln: float | None
    sd_ln: float | None


@dataclass(frozen=True, eq=False)
class CurveReference:
    """Reference for scoring curves.

    Parameters
    ----------
    mean_deg : variable → (101,).
    spreads : mode → variable, or profile and "_side" or "_overall" → distribution of the people themselves,
        leave-one-out. zero : zero of the angles; raw scores require curves with the same zero. n, group,
        source : number, population, origin; printed with every score. speed_matched : they walked at the
        person's speed, else at their comfortable one.
    """

    mean_deg: Mapping[str, Floats]
    spreads: Mapping[Mode, Mapping[str, ScoreSpread]]
    zero: Literal["anatomical", "standing"]
    n: int
    group: str
    source: str
    speed_matched: bool = False


def gvs(curve: Floats, reference: Floats, mode: Mode) -> Floats:
    """Gait variable score of curves (..., 101) relative to one or as many references: RMS over the cycle,
    same unit.
    """
    difference = curve - reference
    if mode == "offset_removed":
        difference = difference - difference.mean(axis=-1, keepdims=True)
    return np.asarray(np.sqrt(np.mean(difference**2, axis=-1)))


def side_profile(scores: Mapping[str, float], variables: Sequence[str]) -> float | None:
    """RMS of the GVS of one side, None unless all `variables` are available."""
    if any(v not in scores for v in variables):
        return None
    return float(_rms(np.array([scores[v] for v in variables])))


def overall_profile(scores: Mapping[Side, Mapping[str, float]], variables: Sequence[str]) -> float | None:
    """RMS of the GVS of both sides with the left pelvis only, None unless all are available."""
    left, right = scores.get("left", {}), scores.get("right", {})
    without_pelvis = [v for v in variables if v not in PELVIS]
    if any(v not in left for v in variables) or any(v not in right for v in without_pelvis):
        return None
    return float(_rms(np.array([left[v] for v in variables] + [right[v] for v in without_pelvis])))


@dataclass(frozen=True, eq=False)
class PeopleCurves:
    """Mean curves of one variable of many people.

    Parameters
    ----------
    curves : (people, 2, 101) of the left and the right side, 0 if missing. there : (people, 2) availability.
    """

    curves: Floats
    there: Bools

    def means(self) -> Floats:
        """Mean curve (n, 101) over the available sides, for everyone with at least one, in order."""
        counts = self.there.sum(axis=1)
        return np.asarray(self.curves.sum(axis=1)[counts > 0] / counts[counts > 0, None])


def gather_curves(people: Sequence[MeanCurves], variable: str) -> PeopleCurves:
    """Collect the curves of one variable; without any curve the arrays have no samples."""
    rows = [[person.get(side, {}).get(variable) for side in SIDES] for person in people]
    known_curves = [row for pair in rows for row in pair if row is not None]
    shape = len(people), len(SIDES)
    available = np.array([[row is not None for row in pair] for pair in rows], np.bool_).reshape(shape)
    curves = np.zeros((*shape, len(known_curves[0]) if known_curves else 0))
    if known_curves:
        curves[available] = known_curves
    return PeopleCurves(curves, available)


def leave_one_out(people: Sequence[MeanCurves]) -> dict[Mode, dict[str, ScoreSpread]]:
    """Scores of healthy people, each relative to the mean of the others; omitted with fewer than two people.

    Each side counts separately; percentiles are linear between order statistics, sd with n − 1.
    """
    shape = len(people), len(SIDES), len(NINE)
    scores, available = {mode: np.zeros(shape) for mode in MODES}, np.zeros(shape, np.bool_)
    for k, variable in enumerate(NINE):
        gathered = gather_curves(people, variable)
        own, has_curves = gathered.means(), gathered.there.any(axis=1)
        if len(own) < 2:
            continue
        available[..., k] = gathered.there
        mean_of_others = (own.sum(axis=0) - own) / (len(own) - 1)
        for mode in MODES:
            scores[mode][has_curves, :, k] = gvs(gathered.curves[has_curves], mean_of_others[:, None], mode)
    return {mode: _find_spreads(scores[mode], available) for mode in MODES}


def _find_spreads(scores: Floats, available: Bools) -> dict[str, ScoreSpread]:
    """Spreads of every variable and profile of scores (people, 2, 9), where available."""
    values = {variable: scores[..., k][available[..., k]] for k, variable in enumerate(NINE)}
    flat = len(scores), len(SIDES) * len(NINE)
    for name, variables in PROFILES.items():
        left = [NINE.index(v) for v in variables]
        right = [len(NINE) + NINE.index(v) for v in variables if v not in PELVIS]
        values[f"{name}_side"] = _find_profiles(scores, available, left)
        values[f"{name}_overall"] = _find_profiles(
            scores.reshape(flat), available.reshape(flat), left + right
        )
    return {name: _spread(x) for name, x in values.items() if len(x) > 1}


def _find_profiles(scores: Floats, available: Bools, columns: Sequence[int]) -> Floats:
    """RMS of some columns (..., n) where all of them are available."""
    # `take` lays them side by side, so that each is added up as the profile of one person is
    profiles = _rms(np.take(scores, columns, axis=-1))
    return np.asarray(profiles[np.take(available, columns, axis=-1).all(axis=-1)])


def _rms(values: Floats) -> Floats:
    """Root mean square over the last axis."""
    return np.asarray(np.sqrt(np.mean(np.square(values), axis=-1)))


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
