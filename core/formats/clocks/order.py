"""Rows out of order, stored twice, or with a stamp that contradicts the rows around it."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np

from sagittal.core.formats.clocks.step import Ints
from sagittal.core.frames import Bools, Floats


@dataclass(frozen=True)
class SortedRuns:
    """Runs of rows in their true order.

    Parameters
    ----------
    order : (k,) indices of the runs that are kept. wrong : (k,) whether the stamp of each is to be ignored.
    moved, repeated, unplaced : runs that were sorted, dropped as duplicates, dropped without a place.
    """

    order: Ints
    wrong: Bools
    moved: Ints
    repeated: Ints
    unplaced: Ints


def sort_runs(stamps: Floats, widths: Ints, step: float, same: Floats) -> SortedRuns:
    """Put runs of rows into their true order.

    Parameters
    ----------
    stamps : (m,) of each run. widths : (m,) rows of each. step : of one row. same : (m,) equal for runs with
        equal signals.
    """
    m = len(stamps)
    chain = _longest_rise(stamps)
    on = np.zeros(m, np.bool_)
    on[chain] = True
    off = np.flatnonzero(~on)
    positions = np.searchsorted(chain, off)
    groups = np.split(off, np.flatnonzero(np.diff(positions)) + 1) if len(off) else []
    sorting = _Sorting(stamps, widths, step, chain, same)
    # those that have no room where they are go first: others are not to be timed by a hole that is theirs
    roomy = [sorting.has_room(group) for group in groups]
    for group in (g for g, stays in zip(groups, roomy, strict=True) if not stays):
        sorting.move(group)
    for group in (g for g, stays in zip(groups, roomy, strict=True) if stays):
        if sorting.has_room(group):
            sorting.distrust(group)
        else:
            sorting.move(group)
    place = np.arange(m, dtype=np.float64)
    place[list(sorting.moved)] = list(sorting.moved.values())
    wrong, drop = np.zeros(m, np.bool_), np.zeros(m, np.bool_)
    wrong[sorting.wrong] = True
    drop[sorting.repeated + sorting.unplaced] = True
    order = np.argsort(place, kind="stable")
    order = order[~drop[order]]
    moved, repeated, unplaced = (
        np.array(sorted(x), np.int64) for x in (sorting.moved, sorting.repeated, sorting.unplaced)
    )
    return SortedRuns(order, wrong[order], moved, repeated, unplaced)


class _Sorting:
    """Runs outside the chain of increasing stamps, and the gaps of the chain that can receive them.

    Gap k precedes the k-th run of the chain.
    """

    def __init__(self, stamps: Floats, widths: Ints, step: float, chain: Ints, same: Floats) -> None:
        self._stamps, self._widths, self._step, self._chain, self._same = stamps, widths, step, chain, same
        self._along = stamps[chain]
        self._taken: dict[int, float] = {}
        self.moved: dict[int, float] = {}
        self.wrong: list[int] = []
        self.repeated: list[int] = []
        self.unplaced: list[int] = []

    def _room(self, k: int) -> float:
        """Rows that are missing in hole k."""
        if not 0 < k < len(self._chain):
            return np.inf
        low = self._chain[k - 1]
        span = (self._along[k] - self._along[k - 1]) / self._step
        return float(span - self._widths[low] - self._taken.get(k, 0.0))

    def has_room(self, group: Ints) -> bool:
        """Whether as many rows are missing where the group is in the file."""
        position = int(np.searchsorted(self._chain, group[0]))
        return bool(self._room(position) >= self._widths[group].sum() - 0.4)

    def distrust(self, group: Ints) -> None:
        """Keep the place of a group and ignore its stamps, but for duplicates."""
        position = int(np.searchsorted(self._chain, group[0]))
        for i in group.tolist():
            if self._twin(i)[1]:
                self.repeated.append(i)
            else:
                self.wrong.append(i)
                self._taken[position] = self._taken.get(position, 0.0) + self._widths[i]

    def move(self, group: Ints) -> None:
        """Put every run of a group where its stamp belongs, if there is a hole."""
        position = int(np.searchsorted(self._chain, group[0]))
        for i in group.tolist():
            has_twin, equal = self._twin(i)
            k = int(np.searchsorted(self._along, self._stamps[i], side="left"))
            if has_twin and equal:
                self.repeated.append(i)
            elif not has_twin and 0 < k < len(self._chain) and self._room(k) >= 0.6:
                share = _share(self._along[k - 1], self._along[k], self._stamps[i])
                self.moved[i] = float(self._chain[k - 1]) + 0.25 + 0.5 * share
                self._taken[k] = self._taken.get(k, 0.0) + self._widths[i]
            elif self._room(position) >= 0.6:
                self.wrong.append(i)
                self._taken[position] = self._taken.get(position, 0.0) + self._widths[i]
            else:
                self.unplaced.append(i)

    def _twin(self, i: int) -> tuple[bool, bool]:
        """Whether the chain has a run with this stamp, and whether its signals are equal too."""
        k = int(np.searchsorted(self._along, self._stamps[i], side="left"))
        for j in (k - 1, k):
            if 0 <= j < len(self._chain) and abs(self._along[j] - self._stamps[i]) < 0.25 * self._step:
                return True, bool(self._same[self._chain[j]] == self._same[i])
        return False, False


def _share(low: float, high: float, value: float) -> float:
    return float(np.clip((value - low) / (high - low), 0.0, 1.0)) if high > low else 0.5


def _longest_rise(x: Floats) -> Ints:
    """Indices of a longest non-decreasing subsequence; all of them where nothing falls."""
    if not (np.diff(x) < 0).any():
        return np.arange(len(x), dtype=np.int64)
    tails: list[float] = []
    ends: list[int] = []
    back = np.full(len(x), -1, np.int64)
    for i, value in enumerate(x.tolist()):
        k = bisect_right(tails, value)
        if k == len(tails):
            tails.append(value)
            ends.append(i)
        else:
            tails[k], ends[k] = value, i
        if k:
            back[i] = ends[k - 1]
    out = np.empty(len(tails), np.int64)
    i = ends[-1]
    for k in range(len(tails) - 1, -1, -1):
        out[k], i = i, int(back[i])
    return out
