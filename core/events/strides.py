"""GaitEvents → Strides: one list with a reason for every excluded cycle.

Nothing is deleted: later stages and the therapist see every cycle and the reason for its exclusion.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.errors import Notice
from sagittal.core.events.flags import StrideParams, decide_exclusions, flag_cycles
from sagittal.core.events.result import COMPARED, GaitEvents, Stride, StrideFlag, Strides, list_known
from sagittal.core.frames import FOOT, SIDES, Bools, Floats, Oriented, Side
from sagittal.core.message import Message, join_messages
from sagittal.core.plurals import plural
from sagittal.core.rotation import wrap_angle, yaw

NEAR_S: Final = 0.3
"""A contact so near lost samples may be wrong: it is found by what comes up to 0.25 s before and after it
(docs/science/events.md, "Refinement"). At the edge of a hole of 0.3 s it was up to 0.15 s off."""

NOTICES: Final = ("short_walk", "no_strides")
"""Codes of what the stride list says about itself."""


def stride_list(
    events: GaitEvents,
    orientations: Oriented,
    turning: Bools | None = None,
    params: StrideParams | None = None,
) -> Strides:
    """All cycles of both feet in chronological order, with the other foot's events and exclusions.

    Parameters
    ----------
    events : contacts, from a detector or manually edited.
    orientations : of the feet, for gaps and heading.
    turning : (n,) mask on the orientations' axis (from the pelvis), None if unknown.

    Returns
    -------
    Strides with flags: "gap" (data loss of the foot inside or within `NEAR_S`), "incomplete" (not exactly one
    terminal contact, or two landings of the other foot: a contact was missed), "implausible_time", "turn",
    "outlier" of the foot's stride times, "first" / "last" of a bout, "near_turn", "non_periodic" (alone);
    excluded_reason is the first of them. The other foot's contacts are None during a data loss of its sensor.
    """
    params = params or StrideParams()
    plain = [
        stride
        for side in SIDES
        for stride in flag_cycles(side_strides(side, events, orientations, turning, params), params)
    ]
    plain.sort(key=lambda s: (s.start_s, s.side))
    return count_strides(plain, params)


def count_strides(strides: Sequence[Stride], params: StrideParams) -> Strides:
    """Apply the exclusions given by the flags, and add notices about the remaining strides."""
    listed, near_turns = decide_exclusions(strides, params)
    return Strides(tuple(listed), (*_short_walk(listed, near_turns), *_unused(listed)))


def side_strides(
    side: Side,
    events: GaitEvents,
    orientations: Oriented,
    turning: Bools | None,
    params: StrideParams,
) -> list[Stride]:
    """Cycles of one foot with every reason independent of neighbours; arguments as in `stride_list`."""
    opposite: Side = "right" if side == "left" else "left"
    contacts, leavings = np.array(events.times(side, "ic")), np.array(events.times(side, "tc"))
    n = len(orientations.t_s)
    places = np.searchsorted(orientations.t_s, contacts)
    first, past = places[:-1], places[1:]
    foot = FOOT[side]
    reach = np.searchsorted(orientations.t_s, (contacts[:-1] - NEAR_S, contacts[1:] + NEAR_S))

    def is_lost(which: Side) -> Bools:
        """Whether samples of a foot are missing in each cycle, or so close to it that a contact may be
        wrong.
        """
        if FOOT[which] not in orientations.valid:
            return np.zeros(len(first), np.bool_)
        total = _total(~orientations.valid[FOOT[which]])
        return np.asarray(total[reach[1]] > total[reach[0]])

    in_turn = _total(np.zeros(n, np.bool_) if turning is None else turning)
    start, end = contacts[:-1], contacts[1:]
    tc, left = _inside(leavings, start, end)
    landed, landings = _inside(np.array(events.times(opposite, "ic")), start, end)
    opposite_ic = np.where(landings == 1, landed, np.nan)
    opposite_tc, _ = _inside(
        np.array(events.times(opposite, "tc")), start, np.where(landings == 1, opposite_ic, end)
    )
    # of a foot that is lost for a while nobody knows which of its contacts is which
    unknown = is_lost(opposite)
    opposite_ic, opposite_tc = (np.where(unknown, np.nan, x) for x in (opposite_ic, opposite_tc))
    gap = is_lost(side)
    turn = np.full(len(start), np.nan)
    if foot in orientations.q:
        heading = yaw(orientations.q[foot][np.minimum(places, n - 1)])
        turn = np.where(gap, np.nan, wrap_angle(np.diff(heading)))
    masks: dict[StrideFlag, Bools] = {
        "gap": gap,
        "incomplete": (left != 1) | (landings > 1),
        "implausible_time": (end - start < params.min_s) | (end - start > params.max_s),
        "turn": (np.abs(turn) > params.turn_rad)
        | (in_turn[past] - in_turn[first] > params.turn_share * (past - first)),
    }
    flags: list[tuple[StrideFlag, ...]] = [()] * len(start)
    for flag, mask in masks.items():
        for i in np.flatnonzero(mask).tolist():
            flags[i] = (*flags[i], flag)
    optional_columns = (list_known(x) for x in (tc, opposite_tc, opposite_ic, turn))
    return [
        Stride(side, a, off, b, other_off, other_ic, turned, flags=own)
        for a, b, off, other_off, other_ic, turned, own in zip(
            start.tolist(), end.tolist(), *optional_columns, flags, strict=True
        )
    ]


def _total(mask: Bools) -> NDArray[np.int64]:
    """Cumulative number of true values of a mask (n,) before each sample, (n + 1,)."""
    return np.concatenate(([0], np.cumsum(mask, dtype=np.int64)))


def _inside(times: Floats, lower: Floats, upper: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """First of increasing times in each open range (lower, upper), NaN without one; and the number in it."""
    first = np.searchsorted(times, lower, "right")
    count = np.searchsorted(times, upper, "left") - first
    return np.where(count > 0, np.append(times, np.nan)[first], np.nan), count


def _short_walk(strides: Sequence[Stride], near_turns: bool) -> list[Notice]:
    """Notices on too few strides for a comparison, and on counting those next to a turn."""
    left = Counter(s.side for s in strides if s.excluded_reason is None)
    few = [side for side in SIDES if 0 < left[side] < COMPARED]
    sentences: list[str] = []
    if few:
        counts = " and ".join(f"{left[side]} {side}" for side in few)
        word = plural(sum(left[s] for s in few), "stride counts", "strides count")
        sentences.append(
            Message(
                "Only {counts} {word}; at least {COMPARED} per side are needed for a comparison. Walk "
                "further straight ahead.",
                counts=counts,
                word=word,
                COMPARED=COMPARED,
            )
        )
    if near_turns:
        sentences.append("Because so few remain, strides next to a turn are included.")
    return [Notice("short_walk", join_messages(*sentences))] if sentences else []


def _unused(strides: Sequence[Stride]) -> list[Notice]:
    """Notice on a foot that walked without any counted stride."""
    notices = []
    for side in SIDES:
        own = [s for s in strides if s.side == side]
        if own and all(s.excluded_reason for s in own):
            reasons = Counter(s.excluded_reason for s in own)
            words = ", ".join(f"{n} {reason}" for reason, n in reasons.most_common())
            message = plural(
                len(own),
                Message(
                    "The only {side} stride is excluded: {words}. Gait initiation, turns and termination are "
                    "excluded: walk further straight ahead.",
                    side=side,
                    words=words,
                ),
                Message(
                    "All {own} {side} strides are excluded: {words}. Gait initiation, turns and "
                    "termination are excluded: walk further straight ahead.",
                    own=len(own),
                    side=side,
                    words=words,
                ),
            )
            notices.append(Notice("no_strides", message, FOOT[side]))
    return notices
