"""Values of strides → mean, spread, coefficient of variation and confidence interval of a parameter.

The interval is Student's for the mean of independent values. Strides of one walk vary slowly, so that it is a
lower limit of the uncertainty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import hypot, sqrt
from typing import Final

import numpy as np

from sagittal.core.events.result import COMPARED
from sagittal.core.frames import Floats, Side
from sagittal.core.parameters.catalogue import name_counted
from sagittal.core.parameters.result import Parameter

CV_STRIDES: Final = 10
"""Fewer strides have no coefficient of variation: it would say little. Customary."""

STEADY_STRIDES: Final = 30
"""Fewer strides than this carry the note `few_strides`."""

CONFIDENCE: Final = 0.95
"""Of the interval of the mean."""

NORMAL_95: Final = 1.96
"""Two-sided quantile of `CONFIDENCE` of the normal distribution."""

TOO_FEW: Final = "too_few_strides"
"""Reason of a comparison that is not made for want of strides."""


def has_enough_values(p: Parameter) -> bool:
    """Whether there are enough strides, steps or repetitions for a comparison with another side or visit,
    a norm or a limit.
    """
    return p.n >= COMPARED or name_counted(p.name) not in {"strides", "steps", "repetitions"}


def summarise_values(
    name: str, side: Side | None, values: Sequence[float] | Floats, unit: str, reason: str | None = None
) -> Parameter:
    """One parameter from its values; without values the reason instead."""
    if not len(values):
        return Parameter(name, side, 0, None, None, unit, reason or "no_strides")
    x = np.asarray(values, np.float64)
    n, (mean, sd) = len(x), mean_and_sd(x)
    half = None if sd is None else t_quantile(n - 1) * sd / sqrt(n)
    return Parameter(
        name,
        side,
        n,
        mean,
        sd,
        unit,
        cv_pct=_vary(x, mean, sd, unit),
        ci_low=None if half is None else mean - half,
        ci_high=None if half is None else mean + half,
        note="few_strides" if n < STEADY_STRIDES else None,
    )


def mean_and_sd(x: Floats) -> tuple[float, float | None]:
    """Mean of values (n ≥ 1,) and their standard deviation (n − 1), None for a single value.

    Bit-identical to `x.mean()` and `x.std(ddof=1)`, without their overhead for axes and masks.
    """
    n = len(x)
    mean = np.add.reduce(x) / n
    off = x - mean
    return float(mean), sqrt(np.add.reduce(off * off) / (n - 1)) if n > 1 else None


def cv_pct(values: Sequence[float] | Floats, unit: str) -> float | None:
    """Coefficient of variation 100 sd / mean, sd with n − 1.

    None below `CV_STRIDES` values, for angles, and unless all values are positive: a ratio is meaningless for
    a quantity with a conventional zero or with zero crossings.
    """
    x = np.asarray(values, np.float64)
    return _vary(x, *mean_and_sd(x), unit) if len(x) else None


def _vary(x: Floats, mean: float, sd: float | None, unit: str) -> float | None:
    if len(x) < CV_STRIDES or unit == "deg" or sd is None or not x.min() > 0.0:
        return None
    return 100.0 * sd / mean


@dataclass(frozen=True)
class Spread:
    """Mean, standard deviation (n − 1; None below two) and number of the values of one side.

    Parameters
    ----------
    own : standard uncertainty of the measurement of this side that does not average out over strides.
    """

    mean: float
    sd: float | None
    n: int
    own: float = 0.0


def difference_interval(a: Spread, b: Spread) -> tuple[float, float] | None:
    """95 % interval of a − b, None without spreads (Welch 1947, Biometrika 34:28; degrees of freedom rounded
    down).

    The measurement uncertainty of each side is added in quadrature: it does not decrease with the number of
    strides.
    """
    if a.sd is None or b.sd is None:
        return None
    variance_a, variance_b = a.sd**2 / a.n, b.sd**2 / b.n
    variance = variance_a + variance_b
    half = 0.0
    if variance > 0.0:
        freedom = variance**2 / (variance_a**2 / (a.n - 1) + variance_b**2 / (b.n - 1))
        half = t_quantile(max(int(freedom), 1)) * sqrt(variance)
    half = hypot(half, NORMAL_95 * hypot(a.own, b.own))
    return a.mean - b.mean - half, a.mean - b.mean + half


def differ(a: Spread, b: Spread) -> bool:
    """Whether the sides differ: the interval of the difference excludes 0."""
    ends = difference_interval(a, b)
    return ends is not None and ends[0] * ends[1] > 0.0


@cache
def t_quantile(freedom: int) -> float:
    """Two-sided Student quantile of `CONFIDENCE` with `freedom` ≥ 1 degrees of freedom."""
    from scipy.special import stdtrit  # slow import

    return float(stdtrit(freedom, 0.5 + 0.5 * CONFIDENCE))
