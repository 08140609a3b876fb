"""Selection of sensor columns in a block; usually all of them in order."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sagittal.core.frames import Bools, Floats, Segment

Columns = NDArray[np.int64] | None
"""Places of some sensors among others; None = all of these in the same order, nothing is copied."""


def find_columns(requested: Sequence[Segment], available: Sequence[Segment]) -> Columns:
    """Columns of some segments among others."""
    if tuple(requested) == tuple(available):
        return None
    return np.array([available.index(s) for s in requested], np.int64)


def take_mask(mask: Bools, columns: Columns) -> Bools:
    """Some columns of a mask (T, n), in the memory layout of `take_columns`."""
    return mask if columns is None else mask.take(columns, axis=1)


def take_columns(acc: Floats, gyr: Floats, valid: Bools, columns: Columns) -> tuple[Floats, Floats, Bools]:
    """acc, gyr (T, n, 3), valid (T, n) of some columns.

    In C order, as from `take` and unlike indexing: another memory layout would compile another kernel.
    """
    if columns is None:
        return acc, gyr, valid
    return acc.take(columns, axis=1), gyr.take(columns, axis=1), take_mask(valid, columns)
