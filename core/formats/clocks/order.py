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
    moved, repeated, unplaced : indices of runs that were sorted, dropped as duplicates, dropped without a place.
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
    place = np.arange(m, dtype=np.float64)
    wrong = np.zeros(m, np.bool_)
    drop = np.zeros(m, np.bool_)
    moved, repeated, unplaced = [], [], []
    along = stamps[chain]
    taken: dict[int, float] = {}
    groups = np.split(off, np.flatnonzero(np.diff(np.searchsorted(chain, off))) + 1) if len(off) else []
    for group in groups:
        at = int(np.searchsorted(chain, group[0]))
        rows_here = int(widths[group].sum())
        room = np.inf
        if 0 < at < len(chain):
            p, q = chain[at - 1], chain[at]
            room = (stamps[q] - stamps[p]) / step - widths[p]
        for i in group:
            k = int(np.searchsorted(along, stamps[i], side="left"))
            near = [chain[j] for j in (k - 1, k) if 0 <= j < len(chain)]
            twin = next((j for j in near if abs(stamps[j] - stamps[i]) < 0.25 * step), None)
            if twin is not None and same[twin] == same[i]:
                drop[i] = True
                repeated.append(i)
            elif room >= rows_here - 0.4:
                wrong[i] = True
            elif twin is None and 0 < k < len(chain) and _has_room(chain, stamps, widths, step, k, i, taken):
                place[i] = chain[k - 1] + 0.25 + 0.5 * _share(along[k - 1], along[k], stamps[i])
                moved.append(i)
            elif room >= 0.6:
                wrong[i] = True
                room -= widths[i]
            else:
                drop[i] = True
                unplaced.append(i)
    order = np.argsort(place, kind="stable")
    order = order[~drop[order]]
    index = lambda rows: np.array(rows, np.int64)  # noqa: E731
    return SortedRuns(order, wrong[order], index(moved), index(repeated), index(unplaced))


def _has_room(
    chain: Ints, stamps: Floats, widths: Ints, step: float, k: int, i: int, taken: dict[int, float]
) -> bool:
    """Whether run i fits between the runs k − 1 and k of the chain, beside those that were put there before."""
    room = (stamps[chain[k]] - stamps[chain[k - 1]]) / step - widths[chain[k - 1]] - taken.get(k, 0.0)
    if room < 0.6:
        return False
    taken[k] = taken.get(k, 0.0) + widths[i]
    return True


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
