"""Summary scores of the deviation of gait from a reference: GVS, GPS, gps_sagittal, GDI*.

docs/science/norms-and-scores.md, "GVS and GPS". Every score exists raw and with offsets removed. Raw scores
require curves with the zero of the reference; angles relative to the person's own standing have none, with a
reason. Half of a healthy adult's raw GPS is pure offset, so the two are never mixed. GDI* = 100 − 10 (ln GPS
− mean) / sd with mean and sd of ln GPS of the reference people: 100 is their mean, every 10 below it one sd
(after Schwartz & Rozumalski 2008); it is not the GDI, whose feature matrix must not be redistributed.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from math import log
from typing import Final

import numpy as np

from sagittal.core.events.result import COMPARED
from sagittal.core.frames import SIDES, Side
from sagittal.core.norms.adults import adult_reference
from sagittal.core.norms.place import percentile_of_z
from sagittal.core.norms.profile import (
    MODES,
    NINE,
    PROFILES,
    CurveReference,
    Mode,
    Profile,
    ScoreSpread,
    gvs,
    overall_profile,
    side_profile,
)
from sagittal.core.norms.tables import wbds_group
from sagittal.core.parameters.anatomical_zero import anatomical_curves
from sagittal.core.parameters.kinematic import MEAN_ZERO, NO_STANDING, mean_curve
from sagittal.core.parameters.result import CycleCurves, MeanCurve
from sagittal.core.parameters.variability import TOO_FEW

GDI_STAR: Final[Mapping[Profile, str]] = {"gps": "gdi_star", "gps_sagittal": "gdi_star_sagittal"}
"""Name of the index made from each profile; the reduced one has a name of its own."""

NOTHING_DEG: Final = 1e-6
"""A smaller profile is rounding: the curves are those of the reference, and the logarithm means nothing."""


@dataclass(frozen=True)
class Score:
    """One score, or the reason for having none.

    Parameters
    ----------
    name : "gvs_deg", "gps_deg", "gps_sagittal_deg", "gdi_star", "gdi_star_sagittal".
    variable : of a GVS, else None. side : None = both.
    mode : "raw" or "offset_removed"; the two have different references.
    value : in `unit`. n : number of strides, the minimum over its curves. healthy : spread of the score (of
        the GPS for a GDI*) among the reference people, degrees.
    percentile : percentage of reference people with a lower score, assuming a log-normal distribution; None
        for a GVS.
    missing : missing variables. reason : "angle_zero_standing", "no_standing" (no quiet standing), "no_level"
        (rotation and progression are relative to their own mean, never to the walking direction),
        "joint_missing", "no_strides", "too_few_strides", "estimated" (not measured by two sensors),
        "variables_missing" (several reasons, see the GVS), "no_reference", "no_norm_for_age", "score_zero"
        (identical to the curves of the reference: no GDI*).
    """

    name: str
    variable: str | None
    side: Side | None
    mode: Mode
    value: float | None
    unit: str
    n: int
    healthy: ScoreSpread | None
    percentile: float | None = None
    missing: tuple[str, ...] = ()
    reason: str | None = None


@dataclass(frozen=True, eq=False)
class Scores:
    """All scores of a session and their reference population.

    Parameters
    ----------
    scores : by mode: GVS of nine variables of each side, then profiles and indices. The movement analysis
        profile (MAP) is the set of GVS with the GPS: `profile`.
    reference_n, group, source, zero : of the reference people, printed with the scores.
    speed_matched : the reference people walked at the person's speed; False: at their comfortable one.
    """

    scores: tuple[Score, ...]
    reference_n: int
    group: str
    source: str
    zero: str
    speed_matched: bool = False

    def find(self, name: str, mode: Mode, side: Side | None = None, variable: str | None = None) -> Score:
        """The score with these properties; KeyError if it cannot exist."""
        for s in self.scores:
            if (s.name, s.mode, s.side, s.variable) == (name, mode, side, variable):
                return s
        raise KeyError((name, mode, side, variable))

    def profile(self, mode: Mode) -> tuple[Score, ...]:
        """Bars of the MAP: GVS by side, then the profiles."""
        return tuple(s for s in self.scores if s.mode == mode and s.unit == "deg")


class CurveMeans:
    """Means of the counted strides for scoring, accumulated from curves as they arrive.

    Parameters
    ----------
    standing_deg : goniometer angles in standing.
    """

    def __init__(self, standing_deg: Mapping[str, float]) -> None:
        self.standing_deg = standing_deg
        self.there: set[Key] = set()
        self.own: dict[Key, MeanCurve] = {}
        self.level: dict[Key, MeanCurve] = {}

    def add(self, curves: CycleCurves) -> None:
        """Add some or all curves, relative to standing."""
        self.there.update((v, side) for v, sides in curves.curves.items() for side in sides)
        self.own |= _means(curves)
        self.level |= _means(anatomical_curves(curves, self.standing_deg))


def score_curves(
    curves: CycleCurves,
    standing_deg: Mapping[str, float] | None = None,
    reference: CurveReference | None = None,
    estimated: Collection[str] = (),
    age: float | None = None,
    means: CurveMeans | None = None,
) -> Scores:
    """Score the mean curves of the counted strides.

    Parameters
    ----------
    curves : relative to standing. standing_deg : goniometer angles in standing
        (`sagittal.core.parameters.anatomical_zero`).
    reference : None = 42 healthy adults at their comfortable speed; at the person's own:
        `sagittal.core.norms.adult_reference_at_speed`.
    estimated : variables not measured by two sensors, which are not scored. age : years; below 18 there is no
        score relative to adults (`no_norm_for_age`). None = adult. means : if the curves are no longer in
        memory; `curves` then contains only metadata.
    """
    if means is None:
        means = CurveMeans(standing_deg or {})
        means.add(curves)
    child = reference is None and wbds_group(age) is None
    reference = adult_reference() if reference is None else reference
    level = means.level if reference.zero == "anatomical" else means.own
    scores: list[Score] = []
    for mode in MODES:
        own = level if mode == "raw" else means.own
        single = [
            _gvs(v, side, mode, own.get((v, side)), means, curves, reference, v in estimated)
            for side in SIDES
            for v in NINE
        ]
        scores += single
        for profile in PROFILES:
            for side in (*SIDES, None):
                scores += _profile(profile, side, mode, single, reference)
    if child:
        scores = [replace(s, value=None, n=0, healthy=None, percentile=None, reason=_CHILD) for s in scores]
    return Scores(
        tuple(scores),
        reference.n,
        reference.group,
        reference.source,
        reference.zero,
        reference.speed_matched,
    )


_CHILD: Final = "no_norm_for_age"

Key = tuple[str, Side]


def _means(curves: CycleCurves) -> dict[Key, MeanCurve]:
    curve_means = {(v, side): mean_curve(curves, v, side) for v in NINE for side in curves.curves.get(v, {})}
    return {key: mean for key, mean in curve_means.items() if mean.mean is not None}


def _gvs(
    variable: str,
    side: Side,
    mode: Mode,
    own: MeanCurve | None,
    means: CurveMeans,
    metadata: CycleCurves,
    reference: CurveReference,
    estimated: bool,
) -> Score:
    healthy = reference.spreads[mode].get(variable)
    reason = None
    if variable not in reference.mean_deg:
        reason = "no_reference"
    elif (variable, side) not in means.own:
        reason_by_curve = metadata.why.get(variable, {}).get(side)
        reason = reason_by_curve or ("no_strides" if (variable, side) in means.there else "joint_missing")
    elif estimated:
        reason = "estimated"
    elif metadata.zero == "walking" and mode == "raw" and variable not in MEAN_ZERO:
        reason, own = NO_STANDING, None
    elif own is None:
        reason = "no_level" if variable in MEAN_ZERO else "angle_zero_standing"
    elif own.n < COMPARED:
        reason = TOO_FEW
    if reason is not None or own is None or own.mean is None:
        missing = (variable,)
        return Score("gvs_deg", variable, side, mode, None, "deg", 0, healthy, None, missing, reason)
    value = float(gvs(np.degrees(own.mean), reference.mean_deg[variable], mode))
    return Score("gvs_deg", variable, side, mode, value, "deg", own.n, healthy)


def _profile(
    profile: Profile, side: Side | None, mode: Mode, single: list[Score], reference: CurveReference
) -> list[Score]:
    """A profile of one side or both, and its index."""
    variables = PROFILES[profile]
    part = [s for s in single if s.variable in variables and side in (None, s.side)]
    by_side: dict[Side, dict[str, float]] = {s: {} for s in SIDES}
    for s in part:
        if s.value is not None and s.side is not None and s.variable is not None:
            by_side[s.side][s.variable] = s.value
    value = overall_profile(by_side, variables) if side is None else side_profile(by_side[side], variables)
    healthy = reference.spreads[mode].get(f"{profile}_{'overall' if side is None else 'side'}")
    missing: tuple[str, ...] = ()
    reason = None
    if value is None:
        lacking = [s for s in part if s.value is None]
        reasons = {s.reason for s in lacking}
        missing = tuple(dict.fromkeys(s.variable for s in lacking if s.variable is not None))
        reason = reasons.pop() if len(reasons) == 1 else "variables_missing"
    n = 0 if value is None else min(s.n for s in part if s.value is not None)
    z = _z(value, healthy)
    zero = value is not None and value < NOTHING_DEG
    index_reason = reason or (None if z is not None else "score_zero" if zero else "no_reference")
    percentile = None if z is None else percentile_of_z(z)
    index = None if z is None else 100.0 - 10.0 * z
    return [
        Score(f"{profile}_deg", None, side, mode, value, "deg", n, healthy, percentile, missing, reason),
        Score(
            GDI_STAR[profile],
            None,
            side,
            mode,
            index,
            "points",
            n,
            healthy,
            percentile,
            missing,
            index_reason,
        ),
    ]


def _z(value: float | None, healthy: ScoreSpread | None) -> float | None:
    """Standard deviations of ln GPS above the reference people; None without a spread."""
    if value is None or value < NOTHING_DEG:
        return None
    if healthy is None or healthy.mean_ln is None or not healthy.sd_ln:
        return None
    return (log(value) - healthy.mean_ln) / healthy.sd_ln
