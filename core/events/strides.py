"""GaitEvents → Strides: one list with a reason for every cycle that does not count.

Nothing is deleted: later stages and the therapist see every cycle and why it was set aside.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import remainder, tau
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from core.errors import Notice
from core.events.result import GaitEvents, Stride, Strides
from core.frames import FOOT, SIDES, Bools, Side
from core.rotation import yaw

if TYPE_CHECKING:
    # the package brings numba, which readers of results do without
    from core.fusion.orientations import Orientations


@dataclass(frozen=True)
class StrideParams:
    """When a cycle counts.

    Parameters
    ----------
    min_s : shorter is two events of one step; the detector itself cannot follow shorter cycles
        (spec/fusion.md §5.4: stride < 0.4 s).
    max_s : longer is a stop, not a stride (mobgap's stride rule: at most 3 s; spec/field.md §4a).
    bout_break_s : a walking bout ends where a foot makes no contact for longer (mobgap: 3 s; same place).
    turn_rad : heading change of the foot over a stride that counts as turning. Our choice: straight strides
        of gaitmap_foot and neura_walk stay within 15°, turning ones exceed 30°.
    turn_share : share of a stride inside the pelvis turning mask that counts as turning. Our choice.
    edge_strides : strides set aside at each end of a bout: gait starts and stops within them
        (spec/clinic.md §3, CV).
    min_kept : the edge strides of a take stay in when fewer would be left on a foot. Our choice: three
        strides are the least with a spread worth printing; the notice `short_walk` says so.
    """

    min_s: float = 0.4
    max_s: float = 3.0
    bout_break_s: float = 3.0
    turn_rad: float = float(np.radians(20.0))
    turn_share: float = 0.25
    edge_strides: int = 1
    min_kept: int = 3


def stride_list(
    events: GaitEvents,
    orientations: Orientations,
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
    excluded_reason, the first that holds: "gap" (the foot's sensor was lost inside), "incomplete" (no
    terminal contact, or the other foot landed twice: a contact was missed), "implausible_time", "turn",
    "first" / "last" of a bout.
    """
    params = params or StrideParams()
    plain = [
        stride for side in SIDES for stride in _side_strides(side, events, orientations, turning, params)
    ]
    edges = _edge_reasons(plain, params)
    kept = {
        side: sum(s.side == side and s.excluded_reason is None and s not in edges for s in plain)
        for side in {s.side for s in edges}
    }
    notices: list[Notice] = []
    if edges and any(n < params.min_kept for n in kept.values()):
        notices.append(
            Notice(
                "short_walk",
                f"The walk is so short that fewer than {params.min_kept} strides of a foot would be left:"
                " the first and last strides, where gait starts and stops, are counted too."
                " Record a longer walk for steady figures.",
            )
        )
    else:
        plain = [replace(s, excluded_reason=edges[s]) if s in edges else s for s in plain]
    plain.sort(key=lambda s: (s.start_s, s.side))
    notices.extend(_unused(plain))
    return Strides(tuple(plain), tuple(notices))


def _side_strides(
    side: Side,
    events: GaitEvents,
    orientations: Orientations,
    turning: Bools | None,
    params: StrideParams,
) -> list[Stride]:
    """Cycles of one foot with every reason that needs no neighbours."""
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
        tc = _first(leavings, start, end)
        landings = _between(other_contacts, start, end)
        opposite_ic = landings[0] if len(landings) == 1 else None
        opposite_tc = _first(other_leavings, start, end if opposite_ic is None else opposite_ic)
        first, past = places[i : i + 2]
        gap = lost[past] > lost[first]
        turn = None
        if heading is not None and not gap:
            turn = remainder(heading[i + 1] - heading[i], tau)
        reason = None
        if gap:
            reason = "gap"
        elif tc is None or len(landings) > 1:
            reason = "incomplete"
        elif not params.min_s <= end - start <= params.max_s:
            reason = "implausible_time"
        elif (turn is not None and abs(turn) > params.turn_rad) or (
            turned[past] - turned[first] > params.turn_share * (past - first)
        ):
            reason = "turn"
        strides.append(Stride(side, start, tc, end, opposite_tc, opposite_ic, turn, reason))
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


def _edge_reasons(strides: Sequence[Stride], params: StrideParams) -> dict[Stride, str]:
    """Counted strides that stand first or last in a walking bout of their foot."""
    reasons: dict[Stride, str] = {}
    for side in SIDES:
        bout: list[Stride] = []
        own = [s for s in strides if s.side == side]
        for i, stride in enumerate(own):
            if stride.duration_s <= params.bout_break_s:
                bout.append(stride)
            if bout and (stride.duration_s > params.bout_break_s or i == len(own) - 1):
                first, last = bout[: params.edge_strides], bout[len(bout) - params.edge_strides :]
                reasons |= dict.fromkeys(last, "last") | dict.fromkeys(first, "first")
                bout = []
    return {s: reason for s, reason in reasons.items() if s.excluded_reason is None}


def _unused(strides: Sequence[Stride]) -> list[Notice]:
    """Say when a foot walked and nothing of it counts."""
    notices = []
    for side in SIDES:
        own = [s for s in strides if s.side == side]
        if own and all(s.excluded_reason for s in own):
            reasons = Counter(s.excluded_reason for s in own)
            words = ", ".join(f"{n} {reason}" for reason, n in reasons.most_common())
            notices.append(
                Notice("no_strides", f"None of the {len(own)} {side} strides counts: {words}.", FOOT[side])
            )
    return notices
