"""Both feet make the same strides: consistency of counts and stride times between left and right.

In walking, each contact of one foot falls between two contacts of the other. A foot with missed or doubled
contacts violates this, and so do two clocks at different rates. Results that need both feet are then
suppressed (docs/science/consistency.md).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from sagittal.core.consistency.doubt import CONTRADICTED, Doubt
from sagittal.core.consistency.walking import judge_alternation
from sagittal.core.errors import Notice
from sagittal.core.events.bouts import Bout
from sagittal.core.events.result import GaitEvents, Strides
from sagittal.core.frames import FOOT, SIDES, Bools, Floats, Side
from sagittal.core.message import Message

COUNT_SHARE: Final = 0.10
LEAST_CONTACTS: Final = 8
"""Limit of the difference of contacts as a share of the larger number, besides one a bout, and the least
contacts that can be judged. Clean recordings reach 0.05 (docs/science/consistency.md)."""
TIME_SHARE: Final = 0.10
LEAST_STRIDES: Final = 4
"""Limit of the difference of the median stride times as a share of the longer, and the least strides a side.
Clean recordings reach 0.04 (festination)."""


def judge_feet(
    events: GaitEvents,
    strides: Strides,
    bouts: Sequence[Bout],
    is_measured: Callable[[Side, Floats], Bools],
) -> tuple[Doubt, ...]:
    """Report contradictions between left and right; nothing if too little walking was recorded to decide.

    Parameters
    ----------
    events, strides : as used for the parameters, edits included. bouts : walking, by the contacts of both
    feet.
    is_measured : whether a foot's sensor was recording at times (n,) s; only then are contacts of the other
    foot counted.
    """
    counts = {side: _count_contacts(events, side, bouts, is_measured) for side in SIDES}
    more = max(counts.values())
    if min(counts.values()) == 0:
        # one foot without a sensor, or without any contact, is told by who looks for contacts
        return ()
    together = judge_alternation(events)
    if together is not None:
        return (together,)
    lost = more - min(counts.values())
    if more >= LEAST_CONTACTS and lost > len(bouts) + COUNT_SHARE * more:
        return (Doubt(_tell_counts(counts), "between_feet"),)
    times = {side: _find_stride_time(strides, side) for side in SIDES}
    left, right = times["left"], times["right"]
    if left is not None and right is not None and abs(left - right) > TIME_SHARE * max(left, right):
        return (Doubt(_tell_times(left, right), "between_feet"),)
    return ()


def _count_contacts(
    events: GaitEvents, side: Side, bouts: Sequence[Bout], is_measured: Callable[[Side, Floats], Bools]
) -> int:
    times_s = np.array(events.times(side, "ic"), np.float64)
    times_s = times_s[is_measured("right" if side == "left" else "left", times_s)]
    return sum(int(((times_s >= b.first_s - 1e-6) & (times_s <= b.end_s + 1e-6)).sum()) for b in bouts)


def _find_stride_time(strides: Strides, side: Side) -> float | None:
    used = [s.end_s - s.start_s for s in strides.strides if s.side == side and s.excluded_reason is None]
    return float(np.median(used)) if len(used) >= LEAST_STRIDES else None


_REMEDY: Final = (
    "Parameters that combine both feet are not reported. Correct the contacts in the timeline, or check "
    "the sensors on both feet and their clocks."
)


def _tell_counts(counts: dict[Side, int]) -> Notice:
    fewer: Side = "left" if counts["left"] < counts["right"] else "right"
    return Notice(
        CONTRADICTED,
        Message(
            "Contacts while walking: left foot {left}, right foot {right}. Both feet take the same number of "
            "strides, so contacts were missed or detected twice. {remedy}",
            left=counts["left"],
            right=counts["right"],
            remedy=_REMEDY,
        ),
        FOOT[fewer],
    )


def _tell_times(left: float, right: float) -> Notice:
    return Notice(
        CONTRADICTED,
        Message(
            "Stride time is {left:.2f} s on the left and {right:.2f} s on the right. It must be equal on "
            "average, so the contacts or the clock of one foot are wrong. {remedy}",
            left=left,
            right=right,
            remedy=_REMEDY,
        ),
    )
