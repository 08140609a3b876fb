"""Resampling of signal segments between times, each to the same number of points."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from sagittal.core.frames import Floats
from sagittal.core.signals.held_samples import give_pages_back


def resample(signals: Iterable[Floats], t_s: Floats, bounds: Floats, points: int = 101) -> list[Floats]:
    """Interpolate signals (n,) on a uniform axis linearly to (pieces, points) each, both ends included.

    Parameters
    ----------
    bounds : (pieces, 2) s. A piece that contains NaN in a signal is completely NaN.
    """
    return list(resample_in_turn(signals, t_s, bounds, points))


def resample_in_turn(
    signals: Iterable[Floats], t_s: Floats, bounds: Floats, points: int = 101
) -> Iterator[Floats]:
    """The same as an iterator over signals: the curves of an hour are as large as its signals."""
    place = (bounds - t_s[0]) * ((len(t_s) - 1) / (t_s[-1] - t_s[0]))
    nowhere = ~np.isfinite(place).all(axis=1)
    place[nowhere] = 0.0
    share = place[:, :1] + (place[:, 1:] - place[:, :1]) * _shares(points)
    low = share.astype(np.int64)
    np.clip(low, 0, len(t_s) - 2, out=low)
    share -= low
    share[nowhere] = np.nan
    if len(bounds) == 1:  # a live stride: all signals at once
        signal_list = tuple(signals)
        yield from _interpolate(np.stack(signal_list), low, share) if signal_list else ()
        return
    for signal in signals:
        (rows,) = _interpolate(np.ascontiguousarray(signal)[None], low, share)
        give_pages_back((signal,))
        yield rows


def _interpolate(signals: Floats, low: NDArray[np.int64], share: Floats) -> Floats:
    """Signals (k, n) interpolated by a fraction between samples, as (k, pieces, points)."""
    lower, rows = signals.take(low, axis=1), signals[:, 1:].take(low, axis=1)
    # in place: ten minutes of all angles are a million points
    rows -= lower
    rows *= share
    rows += lower
    rows[~np.isfinite(rows.sum(axis=-1))] = np.nan
    return rows


@lru_cache(maxsize=8)
def _shares(points: int) -> Floats:
    """Evenly spaced values (points,) from 0 to 1; cached, since every stride uses the same ones."""
    return np.linspace(0.0, 1.0, points)


def first_crossing(pieces: Floats) -> Floats:
    """First upward zero crossing of the rows of (m, points), as a fraction 0 to 1 of the piece; NaN if
    none.
    """
    return _crossing(pieces, last=False)


def last_crossing(pieces: Floats) -> Floats:
    """Last upward zero crossing of the rows of (m, points), as a fraction 0 to 1 of the piece; NaN if
    none.
    """
    return _crossing(pieces, last=True)


def _crossing(pieces: Floats, *, last: bool) -> Floats:
    m, points = pieces.shape
    up = (pieces[:, :-1] < 0.0) & (pieces[:, 1:] >= 0.0)
    index = points - 2 - np.argmax(up[:, ::-1], axis=1) if last else np.argmax(up, axis=1)
    each = np.arange(m)
    a, b = pieces[each, index], pieces[each, index + 1]
    rise = np.where(up.any(axis=1), b - a, np.nan)
    return np.asarray((index - a / rise) / (points - 1))
