"""Foot-flat after each contact: the reference positions for distances.

Foot-flat is the middle of the longest still period between contact and foot-off, or the quietest moment of a
stance without one (core/body/still.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.body.feet import FootTracks
from sagittal.core.events.result import Strides
from sagittal.core.frames import Side
from sagittal.core.signals.rest import find_runs

STANCE_SHARE: Final = 0.7
"""Part of the stride in which its flat is looked for when no foot-off was found."""

OTHER: Final[Mapping[Side, Side]] = {"left": "right", "right": "left"}


@dataclass(frozen=True, eq=False)
class Flats:
    """Foot-flat samples of strides, −1 if the foot never rests or there is no such contact.

    Parameters
    ----------
    first, last : (strides,) after the contacts that begin and end the stride. opposite : (strides,) of the
        other foot, after its contact within.
    """

    first: NDArray[np.intp]
    last: NDArray[np.intp]
    opposite: NDArray[np.intp]

    def select(self, places: slice | NDArray[np.intp]) -> Flats:
        """Those of selected strides of the list."""
        return Flats(self.first[places], self.last[places], self.opposite[places])


def find_flats(strides: Strides, feet: FootTracks) -> Flats:
    """Foot-flat after every initial contact that begins, ends or falls within a stride."""
    stride_columns = strides.columns
    stance = STANCE_SHARE * stride_columns.duration_s
    off = np.where(np.isnan(stride_columns.tc_s), stride_columns.start_s + stance, stride_columns.tc_s)
    first, last, opposite = np.full((3, len(off)), -1)
    for side in feet.p:
        own, other_rows = stride_columns.of[side], stride_columns.of[OTHER[side]]
        # contacts of this foot within the list, each once per stride that ends or crosses with it
        landed = stride_columns.opposite_ic_s.copy()
        landed[own] = stride_columns.end_s[own]
        landed_rows = np.flatnonzero(~np.isnan(landed))
        times, inverse = np.unique(
            np.concatenate((landed[landed_rows], stride_columns.start_s[own])), return_inverse=True
        )
        until = np.full(len(times), np.inf)
        # the first stride in the list counts
        until[inverse[: len(landed_rows)][::-1]] = (landed + stance)[landed_rows][::-1]
        # the stride before tells how long a stance is, where a small step in a turn was not found
        np.minimum.at(until, inverse[len(landed_rows) :], off[own])
        flat_index = _longest(feet, side, *np.searchsorted(feet.t_s, np.stack((times, until))))
        first[own] = flat_index[inverse[len(landed_rows) :]]
        place = np.full(len(off), -1)
        place[landed_rows] = flat_index[inverse[: len(landed_rows)]]
        last[own], opposite[other_rows] = place[own], place[other_rows]
    return Flats(first, last, opposite)


def _longest(
    feet: FootTracks, side: Side, first: NDArray[np.intp], past: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Middle (m,) of a foot's longest rest within each range [first, past), −1 without any."""
    runs = np.array(find_runs(feet.still[side] & feet.valid[side]), np.intp).reshape(-1, 2)
    starts, stops = runs.T
    position, end = np.searchsorted(stops, first, "right"), np.searchsorted(starts, past, "left")
    best, middle = np.zeros(len(first), np.intp), np.full(len(first), -1)
    while len(left := np.flatnonzero(position < end)):
        a, b = np.maximum(starts[position[left]], first[left]), np.minimum(stops[position[left]], past[left])
        longer = b - a > best[left]
        best[left[longer]], middle[left[longer]] = (b - a)[longer], (a + b)[longer] // 2
        position[left] += 1
    return middle
