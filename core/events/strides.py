"""GaitEvents → Strides: one list with a reason for every cycle that does not count.

Nothing is deleted: later stages and the therapist see every cycle and why it was set aside.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from core.errors import Notice
from core.events.flags import StrideParams, decide_exclusions, flag_cycles
from core.events.result import COMPARED, GaitEvents, Stride, StrideFlag, Strides
from core.frames import FOOT, SIDES, Bools, Oriented, Side
from core.rotation import wrap_angle, yaw

NOTICES: Final = ("short_walk", "no_strides")
"""Codes of what the stride list says about itself."""


def stride_list(
    events: GaitEvents,
    orientations: Oriented,
    turning: Bools | None = None,
    params: StrideParams | None = None,
) -> Strides:
    """All cycles of both feet in order of time, with the other foot's events and exclusions.

    Parameters
    ----------
    events : contacts, of a detector or edited by hand.
    orientations : of the feet: gaps and heading.
    turning : (n,) mask on the orientations' axis (from the pelvis), None if not known.

    Returns
    -------
    flags: "gap" (the foot's sensor was lost inside), "incomplete" (not exactly one terminal contact, or the
    other foot landed twice: a contact was missed), "implausible_time", "turn", "outlier" of the foot's stride
    times, "first" / "last" of a bout, "near_turn", "non_periodic" (alone); excluded_reason the first of them.
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
    """The list with what its flags decide, and what must be said about what is left."""
    listed, near_turns = decide_exclusions(strides, params)
    return Strides(tuple(listed), (*_short_walk(listed, near_turns), *_unused(listed)))


def side_strides(
    side: Side,
    events: GaitEvents,
    orientations: Oriented,
    turning: Bools | None,
    params: StrideParams,
) -> list[Stride]:
    """Cycles of one foot with every reason that needs no neighbours; arguments as of `stride_list`."""
    other: Side = "right" if side == "left" else "left"
    contacts, leavings = events.times(side, "ic"), events.times(side, "tc")
    other_contacts, other_leavings = events.times(other, "ic"), events.times(other, "tc")
    n = len(orientations.t_s)
    places = np.searchsorted(orientations.t_s, contacts)
    foot = FOOT[side]
    lost = _total(~orientations.valid[foot] if foot in orientations.q else np.zeros(n, np.bool_))
    turned = _total(np.zeros(n, np.bool_) if turning is None else turning)
    heading = yaw(orientations.q[foot][np.minimum(places, n - 1)]) if foot in orientations.q else None
    strides = []
    for i, (start, end) in enumerate(pairwise(contacts)):
        left = _between(leavings, start, end)
        landings = _between(other_contacts, start, end)
        opposite_ic = landings[0] if len(landings) == 1 else None
        opposite_tc = _first(other_leavings, start, end if opposite_ic is None else opposite_ic)
        first, past = places[i : i + 2]
        gap = lost[past] > lost[first]
        turn = None
        if heading is not None and not gap:
            turn = wrap_angle(heading[i + 1] - heading[i])
        flags: list[StrideFlag] = []
        if gap:
            flags.append("gap")
        if len(left) != 1 or len(landings) > 1:
            flags.append("incomplete")
        if not params.min_s <= end - start <= params.max_s:
            flags.append("implausible_time")
        if (turn is not None and abs(turn) > params.turn_rad) or (
            turned[past] - turned[first] > params.turn_share * (past - first)
        ):
            flags.append("turn")
        tc = left[0] if left else None
        strides.append(Stride(side, start, tc, end, opposite_tc, opposite_ic, turn, flags=tuple(flags)))
    return strides


def _total(mask: Bools) -> NDArray[np.int64]:
    """How often a mask (n,) is true before each sample, (n + 1,)."""
    return np.concatenate(([0], np.cumsum(mask, dtype=np.int64)))


def _between(times: Sequence[float], after: float, before: float) -> Sequence[float]:
    """Those of increasing times in the open range (after, before)."""
    return times[bisect_right(times, after) : bisect_left(times, before)]


def _first(times: Sequence[float], after: float, before: float) -> float | None:
    """First of increasing times in the open range (after, before)."""
    inside = _between(times, after, before)
    return inside[0] if inside else None


def _short_walk(strides: Sequence[Stride], near_turns: bool) -> list[Notice]:
    """Say when so few strides count that nothing is compared, and when those next to a turn had to count."""
    left = Counter(s.side for s in strides if s.excluded_reason is None)
    few = [side for side in SIDES if 0 < left[side] < COMPARED]
    said = []
    if few:
        counts = " and ".join(f"{left[side]} {side}" for side in few)
        word = "stride counts" if sum(left[s] for s in few) == 1 else "strides count"
        said.append(
            f"Only {counts} {word}; fewer than {COMPARED} of a side are compared with nothing. Walk further "
            "straight ahead."
        )
    if near_turns:
        said.append("So few are left that strides next to a turn are counted too.")
    return [Notice("short_walk", " ".join(said))] if said else []


def _unused(strides: Sequence[Stride]) -> list[Notice]:
    """Say when a foot walked and nothing of it counts."""
    notices = []
    for side in SIDES:
        own = [s for s in strides if s.side == side]
        if own and all(s.excluded_reason for s in own):
            reasons = Counter(s.excluded_reason for s in own)
            words = ", ".join(f"{n} {reason}" for reason, n in reasons.most_common())
            said = (
                f"None of the {len(own)} {side} strides counts: {words}. How a walk starts, turns and stops "
                "is left out: walk further straight ahead."
            )
            notices.append(Notice("no_strides", said, FOOT[side]))
    return notices
