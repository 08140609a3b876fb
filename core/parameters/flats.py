"""Where a foot rests after each of its contacts: the places between which distances are measured.

A foot's flat is the middle of its longest stillness between contact and foot-off, or the quietest moment of a
stance without any (core/body/still.py).
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from core.body.feet import FootTracks
from core.events.result import Stride
from core.frames import Side
from core.rest import find_runs

STANCE_SHARE: Final = 0.7
"""Part of the stride in which its flat is looked for when no foot-off was found."""

OTHER: Final[Mapping[Side, Side]] = {"left": "right", "right": "left"}

Places = Mapping[tuple[Side, float], int | None]
"""Foot and initial contact → sample of the flat that follows, None when the foot never rests."""


def find_flats(strides: Sequence[Stride], feet: FootTracks) -> Places:
    """The flat after every initial contact that a stride begins, ends or crosses with."""
    until: dict[tuple[Side, float], float] = {}
    for s in strides:
        stance = STANCE_SHARE * s.duration_s
        until.setdefault((s.side, s.end_s), s.end_s + stance)
        if s.opposite_ic_s is not None:
            until.setdefault((OTHER[s.side], s.opposite_ic_s), s.opposite_ic_s + stance)
    for s in strides:
        off = s.start_s + STANCE_SHARE * s.duration_s if s.tc_s is None else s.tc_s
        # the stride before tells how long a stance is, where a small step in a turn was not found
        until[s.side, s.start_s] = min(off, until.get((s.side, s.start_s), off))
    rests = {side: rest_runs(feet, side) for side in feet.p}
    spans = np.searchsorted(feet.t_s, [(start, stop) for (_, start), stop in until.items()]).tolist()
    return {
        key: _longest(*rests[key[0]], first, past) if key[0] in rests else None
        for key, (first, past) in zip(until, spans, strict=True)
    }


def rest_runs(feet: FootTracks, side: Side) -> tuple[list[int], list[int]]:
    """First and past-the-last samples of every rest of a foot, in order."""
    resting = feet.still[side] & feet.valid[side]
    found = find_runs(resting)
    return [start for start, _ in found], [stop for _, stop in found]


def _longest(starts: Sequence[int], stops: Sequence[int], first: int, past: int) -> int | None:
    """Middle of the longest run within [first, past)."""
    best, middle = 0, None
    for i in range(bisect_right(stops, first), bisect_left(starts, past)):
        a, b = max(starts[i], first), min(stops[i], past)
        if b - a > best:
            best, middle = b - a, (a + b) // 2
    return middle
