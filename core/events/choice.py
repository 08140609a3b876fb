"""Choice between two contact detectors for a foot: pitch and movement, or displacement.

Most feet pitch at foot-off and contact, which times both to a few milliseconds. A foot that is dragged along
the floor or carried flat does not, and the extrema of its pitch are then not contacts. Its displacement is
still reliable: a foot that moves on has not landed. Where most swings by displacement have no contact by
pitch at their end, pitch is rejected for this foot (docs/science/events.md, "Swings by their way").
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from sagittal.core.frames import Floats

SAME_S: Final = 0.1
"""Contacts so close are one. Both finders differ by 0.03 s on ipol_walks (standard deviation)."""
SEEN_SHARE: Final = 0.5
"""The pitch is used if at least this share of the contacts by way has one by pitch: 0.85 and more for all
feet of ipol_walks and stroke_treadmill and of virtual people it reads correctly, 0.67 for one foot of
neura_walk (contacts by way up to 0.13 s late), at most 0.33 for virtual feet that it misreads."""
COUNT_SHARE: Final = 0.8
"""The way is not believed where contacts by pitch outside its swings make it fewer than this share of all:
who never rests between two steps hides them from it. One inside a swing is none: the foot is on its way."""
LEAST: Final = 3
"""So many swings in a row are a gait."""


def count_seen(by_way: Sequence[float] | Floats, by_pitch: Sequence[float] | Floats) -> int:
    """Number of contacts by displacement, s, with a contact by pitch close in time."""
    way, pitch = np.asarray(by_way, np.float64), np.sort(np.asarray(by_pitch, np.float64))
    if not len(way) or not len(pitch):
        return 0
    next_index = np.clip(np.searchsorted(pitch, way), 0, len(pitch) - 1)
    previous_index = np.maximum(next_index - 1, 0)
    apart = np.minimum(np.abs(pitch[next_index] - way), np.abs(pitch[previous_index] - way))
    return int((apart <= SAME_S).sum())


def believes_way(by_way: Sequence[tuple[float, float]], by_pitch: Sequence[float] | Floats) -> bool:
    """Whether the contacts of a foot are those by its way.

    Parameters
    ----------
    by_way : foot-off and contact of its swings, s, increasing. by_pitch : contacts over the same time, s.
    """
    n = len(by_way)
    if n < LEAST:
        return False
    off, on = np.array(by_way, np.float64).T
    pitch = np.asarray(by_pitch, np.float64)
    # the swing that began last before each of them
    last = np.searchsorted(off, pitch, "right") - 1
    outside = int(((last < 0) | (pitch > on[last] + SAME_S)).sum())
    return n >= COUNT_SHARE * (n + outside) and count_seen(on, pitch) < SEEN_SHARE * n
