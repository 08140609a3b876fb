"""Several takes of one visit as one number: their mean, each take counting once.

A take with more strides is no better witness of how somebody walks that day than one with fewer: between
takes people change more than the mean of many strides is uncertain. What every take measures anew averages
out as 1/√k; what all takes share (`u_common`) stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import sqrt

from sagittal.core.errors import ParameterError
from sagittal.core.parameters.result import Parameter


def join_takes(takes: Sequence[Parameter]) -> Parameter:
    """Mean of a parameter over the takes that have a value; of one take that take itself.

    Parameters
    ----------
    takes : the same parameter of the same side in each take, at least one.

    Returns
    -------
    Parameter with n = strides of all takes; sd and cv are of no single take and None. The interval of the
    mean takes the strides of the takes as independent; None where a take has none. No value with the first
    take's reason where no take has one.

    Raises
    ------
    ParameterError
        "no_takes", "unlike_takes" (other parameters or sides).
    """
    if not takes:
        raise ParameterError("no_takes", "No take to take the mean of.")
    first = takes[0]
    if any((p.name, p.side, p.unit) != (first.name, first.side, first.unit) for p in takes):
        raise ParameterError("unlike_takes", "Takes are joined for one parameter of one side.")
    there = [p for p in takes if p.mean is not None]
    if len(there) < 2:
        return there[0] if there else first
    k = len(there)
    mean = sum(p.mean for p in there if p.mean is not None) / k
    halves = [0.5 * (p.ci_high - p.ci_low) for p in there if p.ci_low is not None and p.ci_high is not None]
    half = _mean_of_independent(halves) if len(halves) == k else None
    own = [p.u_own for p in there if p.u_own is not None]
    common = [p.u_common for p in there if p.u_common is not None]
    return replace(
        first,
        n=sum(p.n for p in there),
        mean=mean,
        sd=None,
        reason=None,
        cv_pct=None,
        ci_low=None if half is None else mean - half,
        ci_high=None if half is None else mean + half,
        note=None,
        uncertainty=None,
        u_own=_mean_of_independent(own) if len(own) == k else None,
        # the same error in all, in each as large as its events and sensors leave it
        u_common=sum(common) / k if len(common) == k else None,
        estimated=any(p.estimated for p in there),
    )


def _mean_of_independent(parts: Sequence[float]) -> float:
    """Uncertainty of a mean whose parts are uncertain independently of each other."""
    return sqrt(sum(x * x for x in parts)) / len(parts)
