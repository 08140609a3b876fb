"""Results of event detection: contacts with times, and the stride list used by all later stages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from sagittal.core.errors import Notice
from sagittal.core.frames import SIDES, Bools, Floats, Side

EventKind = Literal["ic", "tc"]
"""ic = initial contact (foot strike), tc = terminal contact (foot off)."""

StrideFlag = Literal[
    "gap",
    "incomplete",
    "implausible_time",
    "turn",
    "in_place",
    "outlier",
    "first",
    "last",
    "near_turn",
    "non_periodic",
]
"""What a rule found about a cycle (core/events/flags.py), in the order in which it names the reason."""

COMPARED: Final = 4
"""Fewer counted strides of a side stand with their number and are compared with nothing: not with the other
side, a norm, a limit or another visit. Our choice: of three the 95 % interval is still wider than twice their
spread."""

MANUAL: Final = "manual"
"""Begins the exclusion reason that a person gave: "manual:<text>"."""


@dataclass(frozen=True)
class GaitEvent:
    """One contact event.

    Parameters
    ----------
    time_s : time of the event, seconds from recording start.
    detected_s : time of the first report by a real-time detector.
    source : name of the detector ("foot_contact"), "consensus" or "manual".
    confidence : 0 to 1, fraction of detectors that found it (core/events/consensus.py); None = one detector.
    uncertainty_s : standard uncertainty of `time_s` relative to a force plate, s; None for manual events or
        if the detector has none. Most of it is common to all events of a foot.
    first_s : time of the first report in a stream, if `time_s` is a later, refined one; else None.
    """

    time_s: float
    side: Side
    kind: EventKind
    source: str
    detected_s: float
    confidence: float | None = None
    uncertainty_s: float | None = None
    first_s: float | None = None

    def rate(self, confidence: float | None) -> GaitEvent:
        """The same event with a different confidence; three times faster than `replace`, which matters for
        thousands.
        """
        return GaitEvent(
            self.time_s,
            self.side,
            self.kind,
            self.source,
            self.detected_s,
            confidence,
            self.uncertainty_s,
            self.first_s,
        )


@dataclass(frozen=True, eq=False)
class GaitEvents:
    """All events of a recording in chronological order, and why a side has none."""

    events: tuple[GaitEvent, ...]
    notices: tuple[Notice, ...] = ()
    diagnostics: Mapping[str, object] = field(default_factory=dict)

    @property
    def contact_uncertainty_s(self) -> float | None:
        """Standard uncertainty of the median contact, manual events excluded; None if unknown."""
        uncertainties = sorted(
            e.uncertainty_s for e in self.events if e.uncertainty_s is not None and e.source != MANUAL
        )
        return uncertainties[len(uncertainties) // 2] if uncertainties else None

    def times(self, side: Side, kind: EventKind) -> tuple[float, ...]:
        """Event times in s of one side and kind, strictly increasing: coincident events are merged."""
        return self._times.get((side, kind), ())

    @cached_property
    def _times(self) -> Mapping[tuple[Side, EventKind], tuple[float, ...]]:
        times_by_key: dict[tuple[Side, EventKind], list[float]] = {}
        for e in self.events:
            times_by_key.setdefault((e.side, e.kind), []).append(e.time_s)
        return {key: tuple(dict.fromkeys(times)) for key, times in times_by_key.items()}


@dataclass(frozen=True)
class Stride:
    """One gait cycle of one foot, initial contact to the next initial contact of the same foot.

    Parameters
    ----------
    start_s, end_s : the two initial contacts; [start, end).
    tc_s : terminal contact between them, None if not detected.
    opposite_tc_s, opposite_ic_s : the other foot's events inside the cycle, None if not detected.
    turn_rad : heading change of the foot over the stride, left positive; None if not known.
    excluded_reason : None = counted; else one of `flags` or "manual:<text>".
    flags : all flags, even if the cycle is counted: a short walk retains strides next to a turn, and a cycle
        may be included manually.
    """

    side: Side
    start_s: float
    tc_s: float | None
    end_s: float
    opposite_tc_s: float | None = None
    opposite_ic_s: float | None = None
    turn_rad: float | None = None
    excluded_reason: str | None = None
    flags: tuple[StrideFlag, ...] = ()

    @property
    def excluded_by(self) -> Literal["rule", "person"] | None:
        """Origin of the exclusion, None if the cycle is counted."""
        if self.excluded_reason is None:
            return None
        return "person" if self.excluded_reason.startswith(MANUAL) else "rule"

    @property
    def duration_s(self) -> float:
        """Stride time, s."""
        return self.end_s - self.start_s


def list_known(values: Floats) -> list[float | None]:
    """The numbers (n,), with NaN for None."""
    listed: list[float | None] = values.tolist()
    for i in np.flatnonzero(np.isnan(values)).tolist():
        listed[i] = None
    return listed


@dataclass(frozen=True, eq=False)
class StrideColumns:
    """A stride list as columns (strides,): times and turn as in `Stride`, NaN if unknown.

    Parameters
    ----------
    counted : whether the stride is counted. of, used : side → indices of all its strides, and of the counted
        ones, in order.
    """

    start_s: Floats
    tc_s: Floats
    end_s: Floats
    opposite_tc_s: Floats
    opposite_ic_s: Floats
    turn_rad: Floats
    counted: Bools
    of: Mapping[Side, NDArray[np.intp]]
    used: Mapping[Side, NDArray[np.intp]]

    @property
    def duration_s(self) -> Floats:
        """Stride times (strides,), s."""
        return self.end_s - self.start_s


@dataclass(frozen=True, eq=False)
class Strides:
    """The stride list of a recording, from which all later values are computed."""

    strides: tuple[Stride, ...]
    notices: tuple[Notice, ...] = ()

    @cached_property
    def columns(self) -> StrideColumns:
        """The list as columns."""
        rows = [
            (s.start_s, s.tc_s, s.end_s, s.opposite_tc_s, s.opposite_ic_s, s.turn_rad) for s in self.strides
        ]
        table = np.ascontiguousarray(np.array(rows, np.float64).reshape(-1, 6).T)
        is_counted = np.array([s.excluded_reason is None for s in self.strides], np.bool_)
        left = np.array([s.side == "left" for s in self.strides], np.bool_)
        rows_by_side = {side: np.flatnonzero(left if side == "left" else ~left) for side in SIDES}
        start_s, tc_s, end_s, opposite_tc_s, opposite_ic_s, turn_rad = table
        return StrideColumns(
            start_s=start_s,
            tc_s=tc_s,
            end_s=end_s,
            opposite_tc_s=opposite_tc_s,
            opposite_ic_s=opposite_ic_s,
            turn_rad=turn_rad,
            counted=is_counted,
            of=rows_by_side,
            used={side: own[is_counted[own]] for side, own in rows_by_side.items()},
        )

    def select_used(self, side: Side | None = None) -> tuple[Stride, ...]:
        """Counted strides of one side or both."""
        return tuple(
            s for s in self.strides if s.excluded_reason is None and (side is None or s.side == side)
        )
