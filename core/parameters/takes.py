"""Combination of several recordings of one visit: the mean of their values, each recording counting once.

A recording with more strides is not more representative of the day: people vary more between recordings than
the uncertainty of the mean over many strides. Errors independent between recordings average out as 1/√k;
errors common to all of them (`u_common`) remain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import sqrt

from sagittal.core.errors import ParameterError
from sagittal.core.parameters.result import Parameter


def join_takes(takes: Sequence[Parameter]) -> Parameter:
    """Mean of a parameter over the recordings that have a value; for one recording its parameter unchanged.

    Parameters
    ----------
    takes : the same parameter of the same side in each recording, at least one.

    Returns
    -------
    Parameter with n = strides of all recordings; sd and cv are None because they are defined for a single
    recording. The interval of the mean assumes independent strides of the recordings; None if a recording has
    none. Without any value the reason of the first recording.

    Raises
    ------
    ParameterError "no_takes", "unlike_takes" (different parameters or sides).
    """
    if not takes:
        raise ParameterError("no_takes", "No take to take the mean of.")
    first = takes[0]
    if any((p.name, p.side, p.unit) != (first.name, first.side, first.unit) for p in takes):
        raise ParameterError("unlike_takes", "Takes are joined for one parameter of one side.")
    valid = [p for p in takes if p.mean is not None]
    if len(valid) < 2:
        return valid[0] if valid else first
    k = len(valid)
    mean = sum(p.mean for p in valid if p.mean is not None) / k
    halves = [0.5 * (p.ci_high - p.ci_low) for p in valid if p.ci_low is not None and p.ci_high is not None]
    half = _mean_of_independent(halves) if len(halves) == k else None
    own = [p.u_own for p in valid if p.u_own is not None]
    common = [p.u_common for p in valid if p.u_common is not None]
    return replace(
        first,
        n=sum(p.n for p in valid),
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
        estimated=any(p.estimated for p in valid),
    )


def _mean_of_independent(parts: Sequence[float]) -> float:
    """Uncertainty of a mean of values with independent uncertainties."""
    return sqrt(sum(x * x for x in parts)) / len(parts)
