"""Storage of samples with reduced memory: in single precision, or in a file.

Recording files have single precision at most, so samples are processed in double precision and stored in
single without loss: this saves 62 MB for an hour of seven sensors. Results of a long recording are read back
block by block, or one signal after the other, and are stored in a file meanwhile.
"""

from __future__ import annotations

import math
import mmap
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final, Protocol, Self, TypeVar

import numpy as np

from sagittal.core.frames import Bools, Floats

Held = TypeVar("Held", bound="HoldsSamples")

SOME_ROWS: Final = 1 << 12
"""Rows that are looked at together: the first that need double precision end the search."""

SHORT: Final = 1 << 16
"""Samples up to which a take is held in memory as a whole: eleven minutes at 100 Hz."""

AT_A_TIME: Final = 1 << 14
"""Samples that are worked on at a time, where what is made on the way is larger than what comes of it."""


class SampleSeries(Protocol):
    """Samples (T, …, 3) accessed in parts: an array, or values computed on access."""

    def __getitem__(self, part: slice, /) -> Floats: ...


def cut_blocks(samples: int) -> Iterator[slice]:
    """Consecutive slices of a recording, in order, for functions that can be applied block by block."""
    for first in range(0, samples, AT_A_TIME):
        yield slice(first, min(first + AT_A_TIME, samples))


def compare_neighbours(x: Floats, metric: Callable[[Floats, Floats], Floats]) -> Floats:
    """Apply `metric` to every sample of x (n, k) and its successor, (n − 1,), block by block."""
    values = np.empty(max(0, len(x) - 1))
    for part in cut_blocks(len(values)):
        values[part] = metric(x[part], x[part.start + 1 : part.stop + 1])
    return values


def is_complete(x: Floats) -> Bools:
    """Rows (n,) of x (n, c) without missing values; ten times faster than np.all for few columns."""
    good = np.isfinite(x[:, 0])
    for axis in range(1, x.shape[1]):
        good &= np.isfinite(x[:, axis])
    return np.asarray(good, np.bool_)


def make_room(rows: int, *more: int, kind: type[np.floating[Any]] = np.float64) -> Any:
    """Allocate an array (rows, more), for a long recording in an unnamed file deleted with it.

    Parameters
    ----------
    rows : number of samples. kind : floating-point type.

    Returns
    -------
    The array. Accessed pages of its file are in memory until `give_pages_back`. The file is in the directory
    for temporary files (`TMPDIR`); without space there the array is in memory.
    """
    size = math.prod((rows, *more)) * np.dtype(kind).itemsize
    if rows <= SHORT or not hasattr(mmap, "MADV_DONTNEED"):
        return np.empty((rows, *more), kind)
    try:
        with tempfile.TemporaryFile() as file:
            # now, since later nobody could be told that the disk is full
            os.posix_fallocate(file.fileno(), 0, size)
            return np.ndarray((rows, *more), kind, mmap.mmap(file.fileno(), size))
    except OSError:
        return np.empty((rows, *more), kind)


def lay_aside(a: Floats) -> Floats:
    """The same array, for a long recording in a file; the original must not be modified afterwards."""
    room: Floats = make_room(*a.shape, kind=a.dtype.type)
    if not isinstance(room.base, mmap.mmap):
        return a
    for part in cut_blocks(len(a)):
        room[part] = a[part]
        give_pages_back((room,))
    return room


def give_pages_back(arrays: Iterable[Floats]) -> None:
    """Release the memory pages of arrays backed by a file; their contents are unchanged."""
    for a in arrays:
        if isinstance(a.base, mmap.mmap):
            a.base.madvise(mmap.MADV_DONTNEED)


class HoldsSamples:
    """Base of classes with sample fields (n, k), named to `hold_samples`; each access returns a copy."""

    sampled: ClassVar[tuple[str, ...]] = ()

    def held(self, name: str) -> Any:
        """A field in its stored precision, single or double; None if it is None."""
        return vars(self)[name]

    def cut(self, name: str, part: slice) -> Floats:
        """A slice of a field, without copying all of it."""
        return np.asarray(vars(self)[name][part], np.float64)

    def change(self, **fields: Any) -> Self:
        """A copy with other fields; unchanged samples are shared."""
        samples = {name: self.held(name) for name in self.sampled}
        return replace(self, **{**samples, **fields})  # type: ignore[type-var] # every class here is a dataclass


@dataclass(frozen=True, eq=False)
class HeldSeries:
    """A sample field in double precision minus an offset (3,), computed for the requested part."""

    of: HoldsSamples
    name: str
    offset: Floats | float = 0.0

    def __getitem__(self, part: slice, /) -> Floats:
        return np.asarray(self.of.cut(self.name, part) - self.offset)


class _HeldField:
    """A field of a frozen dataclass; absent as a class attribute, which would make it a default."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __get__(self, instance: object | None, owner: type) -> Any:
        if instance is None:
            raise AttributeError(self.name)
        a = vars(instance)[self.name]
        return a if a is None or a.dtype == np.float64 else a.astype(np.float64)

    def __set__(self, instance: object, value: Any) -> None:
        vars(instance)[self.name] = None if value is None else _narrow(value)


def hold_samples(*names: str) -> Callable[[type[Held]], type[Held]]:
    """Decorate a dataclass whose fields of these names are samples (n, k) or None."""

    def prepare(owner: type[Held]) -> type[Held]:
        owner.sampled = names
        for name in names:
            setattr(owner, name, _HeldField(name))
        return owner

    return prepare


def _narrow(a: Floats) -> Any:
    """The same samples in single precision if that is exact for all; missing ones are NaN in both."""
    if a.dtype != np.float64:
        return a
    narrow = np.empty(a.shape, np.float32)
    for first in range(0, len(a), SOME_ROWS):
        part = slice(first, first + SOME_ROWS)
        with np.errstate(over="ignore"):
            narrow[part] = a[part]
        if not np.array_equal(narrow[part], a[part], equal_nan=True):
            return a
    return narrow
