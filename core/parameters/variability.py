"""Values of strides → mean, spread, coefficient of variation and confidence interval of a parameter.

The interval is Student's for the mean of independent values. Strides of one walk follow each other slowly
up and down, so that it is the least uncertainty there is, not all of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Final

import numpy as np

from core.frames import Side
from core.parameters.result import Parameter

CV_STRIDES: Final = 10
"""Fewer strides have no coefficient of variation (spec/field.md §4b; PhysiGait's rule)."""

STEADY_STRIDES: Final = 30
"""Fewer strides than this carry the note `few_strides` (spec/clinic.md §3 and §8.5)."""

CONFIDENCE: Final = 0.95
"""Of the interval of the mean."""

UNITS: Final[Mapping[str, str]] = {
    "mps": "m/s",
    "spm": "steps/min",
    "deg": "deg",
    "pct": "%",
    "dps": "deg/s",
    "min": "min",
    "m": "m",
    "s": "s",
}
"""Last part of a parameter's name → its unit (spec/field.md §4a: the unit is in the name); "" has none."""


def unit_of(name: str) -> str:
    """Unit of a parameter, "" for a ratio."""
    return UNITS.get(name.rpartition("_")[2], "")


def summary(
    name: str, side: Side | None, values: Sequence[float], unit: str, reason: str | None = None
) -> Parameter:
    """One parameter from its values; without values the reason stands instead."""
    if not len(values):
        return Parameter(name, side, 0, None, None, unit, reason or "no_strides")
    x = np.asarray(values, np.float64)
    n, mean = len(x), float(x.mean())
    sd = float(x.std(ddof=1)) if n > 1 else None
    half = None if sd is None else t_quantile(n - 1) * sd / float(np.sqrt(n))
    return Parameter(
        name,
        side,
        n,
        mean,
        sd,
        unit,
        cv_pct=cv_pct(x, unit),
        ci_low=None if half is None else mean - half,
        ci_high=None if half is None else mean + half,
        note="few_strides" if n < STEADY_STRIDES else None,
    )


def cv_pct(values: Sequence[float] | np.ndarray, unit: str) -> float | None:
    """Coefficient of variation 100 sd / mean, sd with n − 1 (spec/field.md §4b).

    None below `CV_STRIDES` values, for angles, and for values that are not all positive: a quantity whose
    zero is a convention, or which passes through it, has no ratio.
    """
    x = np.asarray(values, np.float64)
    if len(x) < CV_STRIDES or unit == "deg" or not (x > 0.0).all():
        return None
    return 100.0 * float(x.std(ddof=1)) / float(x.mean())


@cache
def t_quantile(freedom: int) -> float:
    """Two-sided Student quantile of `CONFIDENCE` with `freedom` ≥ 1 degrees of freedom."""
    from scipy.special import stdtrit  # slow import

    return float(stdtrit(freedom, 0.5 + 0.5 * CONFIDENCE))
