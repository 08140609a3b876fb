"""Placement of a value among reference people: z-score, percentile, grade."""

from __future__ import annotations

from dataclasses import dataclass
from math import erf, sqrt
from typing import Final, Literal

from sagittal.core.norms.values import NormValue

GRADES_SD: Final = (1.5, 4.5)
"""|z| up to which a value has grade 0 and 1, beyond 2: the steps of the Edinburgh Visual Gait Score
(docs/science/norms-and-scores.md, "Place")."""

Grade = Literal[0, 1, 2]


@dataclass(frozen=True)
class NormPlacement:
    """Placement of a value among reference people, or the reason for having none.

    Parameters
    ----------
    z : standard deviations above their mean. percentile : percentage of such people below the value, assuming
        a normal distribution.
    grade : 0 within 1.5 sd, 1 within 4.5, 2 above; the lowest grade within value ± uncertainty.
    norm : the reference, even if not comparable.
    reason : "no_value", "no_norm", "not_comparable" (explained in `norm.note`), "no_spread", or the reason of
        a lookup without result.
    """

    z: float | None
    percentile: float | None
    grade: Grade | None
    norm: NormValue | None
    reason: str | None = None


def place_value(
    value: float | None, norm: NormValue | None, reason: str = "no_norm", uncertainty: float | None = None
) -> NormPlacement:
    """Place one value, known ± `uncertainty`; `reason` explains a missing norm, if known."""
    if norm is None:
        return NormPlacement(None, None, None, None, reason)
    if not norm.comparable:
        return NormPlacement(None, None, None, norm, "not_comparable")
    if value is None:
        return NormPlacement(None, None, None, norm, "no_value")
    return _placed(value - norm.mean, norm.sd, norm, uncertainty or 0.0)


def place_difference(left: float | None, right: float | None, norm: NormValue | None) -> NormPlacement:
    """Place left minus right among the left-right differences of healthy people, with an assumed mean of 0.

    Independent of the absolute level: a norm that is not comparable itself can be used if both sides have the
    same zero.
    """
    if norm is None or norm.difference_sd is None:
        return NormPlacement(None, None, None, norm, "no_norm")
    if left is None or right is None:
        return NormPlacement(None, None, None, norm, "no_value")
    return _placed(left - right, norm.difference_sd, norm)


def percentile_of_z(z: float) -> float:
    """Percentage of a normal population below z standard deviations."""
    return 50.0 * (1.0 + erf(z / sqrt(2.0)))


def percentile_of_sample(z: float, n: int) -> float:
    """Percentage below z sample standard deviations, for mean and sd from n people.

    Crawford & Howell 1998 (Clin Neuropsychol 12:482): t = z / √(1 + 1/n) with n − 1 degrees of freedom, so
    that a small control group does not produce extreme percentiles.
    """
    from scipy.special import stdtr

    return float(100.0 * stdtr(n - 1, z / sqrt(1.0 + 1.0 / n)))


def _placed(distance: float, sd: float, norm: NormValue, uncertainty: float = 0.0) -> NormPlacement:
    if sd <= 0.0:
        return NormPlacement(None, None, None, norm, "no_spread")
    z = distance / sd
    percentile = percentile_of_z(z) if norm.n is None else percentile_of_sample(z, norm.n)
    sure = max(abs(z) - uncertainty / sd, 0.0)
    grade: Grade = 0 if sure <= GRADES_SD[0] else 1 if sure <= GRADES_SD[1] else 2
    return NormPlacement(z, percentile, grade, norm)
