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
"""Contacts closer than this are one. The detectors differ by 0.03 s (standard deviation) on ipol_walks."""
SEEN_SHARE: Final = 0.5
"""The pitch is used if at least this share of the contacts by way has one by pitch: 0.85 and more for all
feet of ipol_walks and stroke_treadmill and of virtual people it reads correctly, 0.67 for one foot of
neura_walk (contacts by way up to 0.13 s late), at most 0.33 for virtual feet that it misreads."""
COUNT_SHARE: Final = 0.8
""
"""Displacement is rejected if its swings are fewer than this share of all contacts, those by pitch outside
swings included: a foot that never rests between two steps hides them. A contact within a swing is not one."""
LEAST: Final = 3
"""Minimum number of swings."""


def measure_distance(times: Sequence[float] | Floats, others: Sequence[float] | Floats) -> Floats:
    """Distance (n,) of each of n times to the nearest of other times, s; infinite if there are none."""
    own, other = np.asarray(times, np.float64), np.sort(np.asarray(others, np.float64))
    if not len(other):
        return np.full(len(own), np.inf)
    next_index = np.clip(np.searchsorted(other, own), 0, len(other) - 1)
    previous_index = np.maximum(next_index - 1, 0)
    return np.asarray(np.minimum(np.abs(other[next_index] - own), np.abs(other[previous_index] - own)))


def count_seen(by_way: Sequence[float] | Floats, by_pitch: Sequence[float] | Floats) -> int:
    """Number of contacts by displacement, s, with a contact by pitch close in time."""
    return int((measure_distance(by_way, by_pitch) <= SAME_S).sum())


def believes_way(by_way: Sequence[tuple[float, float]], by_pitch: Sequence[float] | Floats) -> bool:
    """Whether displacement determines the contacts of a foot.

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
