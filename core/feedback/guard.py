"""Side effects of the training: the other side, and the sagittal profile of both legs.

The target parameter affects others, possibly for the worse (Legrand et al. 2025). The last strides are
compared with the first ones of the recording, which had little or no feedback yet.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from statistics import fmean, stdev
from typing import Final, Generic, TypeVar

import numpy as np

from sagittal.core.feedback.baseline import Baseline
from sagittal.core.feedback.cue import GuardState, SideEffect
from sagittal.core.feedback.prescription import Prescription
from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.norms.adults import adult_reference
from sagittal.core.norms.profile import SAGITTAL, gvs, overall_profile

T = TypeVar("T")

FIRST: Final = 10
"""Strides of a side that are its reference (our choice: what a corridor gives)."""

LAST: Final = 20
"""Strides of a side that are compared with it, at least `FIRST` (the window of the progression rule)."""

SPREAD: Final = 2.0
"""Where no source has a limit, more than so many sd of the first strides is watched (our choice)."""

GPS_MCID: Final = (1.6, "MCID of the GPS, Baker et al. 2012, children")
"""Limit in degrees and source; the nearest there is: no source has one of the sagittal profile."""


class GuardWatch:
    """Collects counted strides of both sides and evaluates changes; stores `FIRST` + `LAST` of each side."""

    def __init__(self, prescription: Prescription, baseline: Baseline) -> None:
        self._side = prescription.side
        self._guard = prescription.guard
        self._baseline = baseline
        self._values: dict[Side, _Ends[float]] = {side: _Ends() for side in SIDES}
        self._curves: dict[Side, _Ends[Floats]] = {side: _Ends() for side in SIDES}
        self._state = GuardState()

    @property
    def state(self) -> GuardState:
        """State after the last stride."""
        return self._state

    def add_stride(self, side: Side, value: float, curves: Mapping[str, Floats]) -> None:
        """Add a counted stride: its value of the parameter and its curves (101,) in rad."""
        self._values[side].append(value)
        if all(v in curves for v in SAGITTAL):
            self._curves[side].append(np.stack([np.degrees(curves[v]) for v in SAGITTAL]))
        self._state = GuardState(self._other(), self._gps())

    def _other(self) -> SideEffect:
        if self._side is None:
            return SideEffect(reason="both_sides_trained")
        ends = self._values["right" if self._side == "left" else "left"]
        if not ends.known:
            return SideEffect()
        change = fmean(ends.last) - fmean(ends.first)
        if self._guard.other_change is not None:
            limit, source = self._guard.other_change, "set in the prescription"
        elif self._baseline.other_mdc is not None:
            limit, source = self._baseline.other_mdc, self._baseline.other_mdc_source or ""
        else:
            limit, source = SPREAD * stdev(ends.first), f"{SPREAD:g} SD of the first {FIRST} strides"
        return SideEffect(change, limit, source, abs(change) > limit, None)

    def _gps(self) -> SideEffect:
        limit = self._guard.gps_rise_deg
        if any(not ends.known for ends in self._curves.values()):
            has_strides = any(len(e.first) for e in self._values.values())
            lacks = has_strides and not any(len(e.first) for e in self._curves.values())
            return SideEffect(reason="joint_missing" if lacks else "too_few_strides")
        first = _gps_sagittal({s: np.mean(e.first, axis=0) for s, e in self._curves.items()})
        last = _gps_sagittal({s: np.mean(e.last, axis=0) for s, e in self._curves.items()})
        rise = last - first
        if limit is None:
            return SideEffect(rise, None, None, False, "no_limit")
        source = GPS_MCID[1] if limit == GPS_MCID[0] else "set in the prescription"
        return SideEffect(rise, limit, source, rise > limit, None)


class _Ends(Generic[T]):
    """The first strides, and the last of the later ones."""

    def __init__(self) -> None:
        self.first: list[T] = []
        self.last: deque[T] = deque(maxlen=LAST)

    @property
    def known(self) -> bool:
        """Whether there are enough of both for a comparison."""
        return len(self.last) >= FIRST

    def append(self, value: T) -> None:
        if len(self.first) < FIRST:
            self.first.append(value)
        else:
            self.last.append(value)


def _gps_sagittal(means: Mapping[Side, Floats]) -> float:
    """Sagittal profile score of the mean curves (3, 101) in degrees of both sides, shape only: live angles
    are relative to standing.
    """
    reference = adult_reference().mean_deg
    scores = {
        side: {
            v: float(gvs(row, reference[v], "offset_removed")) for v, row in zip(SAGITTAL, rows, strict=True)
        }
        for side, rows in means.items()
    }
    profile = overall_profile(scores, SAGITTAL)
    assert profile is not None  # noqa: S101 - all of SAGITTAL of both sides are there
    return profile
