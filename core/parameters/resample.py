"""Signals cut at times of strides, each piece on the same number of points."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Final

import numpy as np

from core.frames import Floats

AT_ONCE: Final = 256
"""Pieces whose places are worked out together."""


def resample(signals: Iterable[Floats], t_s: Floats, bounds: Floats, points: int = 101) -> list[Floats]:
    """Interpolate signals (n,) on a uniform axis linearly to (pieces, points) each, both ends included.

    Parameters
    ----------
    bounds : (pieces, 2) s. A piece that touches NaN in a signal is NaN throughout.
    """
    signals = tuple(np.asarray(x) for x in signals)
    ends = (bounds - t_s[0]) * ((len(t_s) - 1) / (t_s[-1] - t_s[0]))
    if len(bounds) == 1:  # a live stride: all signals at once
        return list(_interpolate(np.stack(signals), _place(ends, points), len(t_s)))
    found = [np.empty((len(bounds), points), x.dtype) for x in signals]
    for first in range(0, len(bounds), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        place = _place(ends[part], points)
        for signal, all_rows in zip(signals, found, strict=True):
            (all_rows[part],) = _interpolate(signal[None], place, len(t_s))
    return found


def _place(ends: Floats, points: int) -> Floats:
    """Places (pieces, points) between samples, of pieces that begin and end at places (pieces, 2)."""
    return np.asarray(ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * _shares(points))


def _interpolate(signals: Floats, place: Floats, n: int) -> Floats:
    """Signals (k, n) at places (pieces, points), as (k, pieces, points)."""
    low = np.clip(np.floor(np.where(np.isfinite(place), place, 0.0)).astype(np.int64), 0, n - 2)
    here, rows = signals.take(low, axis=1), signals.take(low + 1, axis=1)
    # in place: ten minutes of all angles are a million points
    rows -= here
    rows *= place - low
    rows += here
    rows[~np.isfinite(rows.sum(axis=-1))] = np.nan
    return rows


@lru_cache(maxsize=8)
def _shares(points: int) -> Floats:
    """So many (points,) from 0 to 1; every stride asks for the same ones."""
    return np.linspace(0.0, 1.0, points)


def first_crossing(pieces: Floats) -> Floats:
    """Where the rows of (m, points) first pass zero upwards, as a share 0 to 1 of the piece; NaN if never."""
    return _crossing(pieces, last=False)


def last_crossing(pieces: Floats) -> Floats:
    """Where the rows of (m, points) last pass zero upwards, as a share 0 to 1 of the piece; NaN if never."""
    return _crossing(pieces, last=True)


def _crossing(pieces: Floats, *, last: bool) -> Floats:
    m, points = pieces.shape
    up = (pieces[:, :-1] < 0.0) & (pieces[:, 1:] >= 0.0)
    at = points - 2 - np.argmax(up[:, ::-1], axis=1) if last else np.argmax(up, axis=1)
    each = np.arange(m)
    a, b = pieces[each, at], pieces[each, at + 1]
    rise = np.where(up.any(axis=1), b - a, np.nan)
    return np.asarray((at - a / rise) / (points - 1))
