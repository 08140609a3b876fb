"""Comparison of left and right, or of the affected and the other side: signed indices, or the difference.

Only the sides are stored; comparisons are derived for display. Every index states which side comes first, and
none is set to 0 or made absolute as a fallback (docs/science/phases-and-regularity.md, "Symmetry").
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import atan, degrees
from typing import Final

import numpy as np

from sagittal.core.events.result import Strides
from sagittal.core.frames import SIDES, Side
from sagittal.core.parameters.flats import OTHER
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.variability import (
    CV_STRIDES,
    STEADY_STRIDES,
    Spread,
    cv_pct,
    difference_interval,
    has_enough_values,
)

KNOWN_TO: Final[Mapping[str, float]] = {"s": 0.01, "m": 0.01, "%": 0.4, "m/s": 0.01}
"""Unit → what a contact (a sample of 10 ms), a place of a foot (1 cm) or a share of the stride is known to.
What mounting and calibration do to one side does not average out over the strides: less is no difference."""

LEAST: Final[Mapping[str, float]] = {unit: 5.0 * known for unit, known in KNOWN_TO.items()}
"""Unit → smallest value that may be divided by. Our choice: five times what it is known to."""


@dataclass(frozen=True)
class Symmetry:
    """Comparison of one parameter between the two sides.

    Parameters
    ----------
    first : the side that comes first: the affected one, else left. reference : "affected/unaffected" or
        "left/right".
    difference : first − other, in `unit`. low, high : its 95 % interval, from strides and measurement, None
        if the spread of a side is unknown. ratio : first / other.
    index_pct : 100 (first − other) / mean of both (Robinson 1987), positive if the first is larger.
    angle_pct : (45° − atan(first / other)) / 90° · 100 (Zifchock 2008), as published: NEGATIVE if the first
        is larger.
    reason : why there is no ratio: "angle" (its zero is a convention), "near_zero" (a side too small to
        divide by, or negative); else None.
    """

    name: str
    unit: str
    first: Side
    reference: str
    difference: float
    ratio: float | None = None
    index_pct: float | None = None
    angle_pct: float | None = None
    reason: str | None = None
    low: float | None = None
    high: float | None = None

    @property
    def clear(self) -> bool:
        """Whether the sides differ significantly: the interval excludes 0, and the difference exceeds the
        resolution.
        """
        is_significant = self.low is not None and self.high is not None and self.low * self.high > 0.0
        return is_significant and abs(self.difference) >= KNOWN_TO.get(self.unit, 0.0)


def compare_sides(parameters: Sequence[Parameter], affected: Side | None = None) -> tuple[Symmetry, ...]:
    """Compare the sides for every parameter with a value of enough strides on both, in the order given.

    Parameters
    ----------
    affected : the affected side, None = none or both: left against right.
    """
    first: Side = affected or "left"
    parameters_by_key = {(p.name, p.side): p for p in parameters}
    reference = "left/right" if affected is None else "affected/unaffected"
    pairs = (
        (parameters_by_key.get((p.name, first)), parameters_by_key.get((p.name, OTHER[first])))
        for p in parameters
        if p.side == first
    )
    return tuple(
        _symmetry(
            a,
            Spread(a.mean, a.sd, a.n, a.u_own or 0.0),
            Spread(b.mean, b.sd, b.n, b.u_own or 0.0),
            first,
            reference,
        )
        for a, b in pairs
        if a is not None and a.mean is not None and has_enough_values(a)
        if b is not None and b.mean is not None and has_enough_values(b)
    )


def ratio(first: float, second: float) -> float:
    """first / second."""
    return first / second


def index_pct(first: float, second: float) -> float:
    """Symmetry index of Robinson 1987: 100 (first − second) / (½ (first + second)), signed."""
    return 100.0 * (first - second) / (0.5 * (first + second))


def angle_pct(first: float, second: float) -> float:
    """Symmetry angle of Zifchock 2008 of two positive values: (45° − atan(first / second)) / 90° · 100."""
    return (45.0 - degrees(atan(first / second))) / 90.0 * 100.0


def phase_coordination(strides: Strides) -> Parameter:
    """`pci_pct`: accuracy and consistency of the phase of the other foot's contact (Plotnik et al. 2007).

    φ = 360° · (time of the other foot's contact in the stride / stride time), over the counted strides of the
    foot with the longer swing; PCI = CV(φ) + 100 mean|φ − 180°| / 180°, so that 0 is perfect.

    Returns
    -------
    Parameter; without a value a reason: "no_strides", "opposite_foot_missing", "no_terminal_contact",
    "few_strides" (below 10, as for every measure of variability).
    """
    name = "pci_pct"
    stride_columns = strides.columns
    swing = stride_columns.end_s - stride_columns.tc_s
    swings = {side: swing[own][~np.isnan(swing[own])] for side, own in stride_columns.used.items()}
    if not stride_columns.counted.any():
        return Parameter(name, None, 0, None, None, "%", "no_strides")
    if not all(map(len, swings.values())):
        one_foot = not all(map(len, stride_columns.used.values()))
        reason = "opposite_foot_missing" if one_foot else "no_terminal_contact"
        return Parameter(name, None, 0, None, None, "%", reason)
    own = stride_columns.used[max(SIDES, key=lambda side: float(swings[side].mean()))]
    phi = (
        360.0
        * (stride_columns.opposite_ic_s[own] - stride_columns.start_s[own])
        / stride_columns.duration_s[own]
    )
    phi = phi[~np.isnan(phi)]
    cv = cv_pct(phi, "") if len(phi) >= CV_STRIDES else None
    if cv is None:
        return Parameter(name, None, len(phi), None, None, "%", "few_strides")
    value = cv + 100.0 * float(np.abs(phi - 180.0).mean()) / 180.0
    note = "few_strides" if len(phi) < STEADY_STRIDES else None
    return Parameter(name, None, len(phi), value, None, "%", note=note)


def _symmetry(parameter: Parameter, first: Spread, second: Spread, side: Side, reference: str) -> Symmetry:
    low, high = difference_interval(first, second) or (None, None)
    a, b = first.mean, second.mean
    plain = Symmetry(parameter.name, parameter.unit, side, reference, a - b, low=low, high=high)
    if parameter.unit == "deg":
        return replace(plain, reason="angle")
    if min(a, b) <= LEAST.get(parameter.unit, 0.0):
        return replace(plain, reason="near_zero")
    return replace(plain, ratio=ratio(a, b), index_pct=index_pct(a, b), angle_pct=angle_pct(a, b))
