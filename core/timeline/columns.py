"""Sensors of a block by their columns: most often all of them, as they stand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sagittal.core.frames import Bools, Floats, Segment

Columns = NDArray[np.int64] | None
"""Places of some sensors among others; None = all of these in the same order, nothing is copied."""


def find_columns(wanted: Sequence[Segment], there: Sequence[Segment]) -> Columns:
    """Where some segments stand among others."""
    if tuple(wanted) == tuple(there):
        return None
    return np.array([there.index(s) for s in wanted], np.int64)


def take_mask(mask: Bools, columns: Columns) -> Bools:
    """A mask (T, n) of some columns, laid out as in `take_columns`."""
    return mask if columns is None else mask.take(columns, axis=1)


def take_columns(acc: Floats, gyr: Floats, valid: Bools, columns: Columns) -> tuple[Floats, Floats, Bools]:
    """acc, gyr (T, n, 3), valid (T, n) of some columns.

    Laid out in order, as `take` does and an index would not: another layout is another kernel.
    """
    if columns is None:
        return acc, gyr, valid
    return acc.take(columns, axis=1), gyr.take(columns, axis=1), take_mask(valid, columns)
