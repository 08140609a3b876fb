"""Returning memory to the operating system: arrays with separate pages, and memory retained by the C library.

The C library keeps freed memory for later allocations: large arrays that are freed one after the other while
another one grows would all remain resident.
"""

from __future__ import annotations

import ctypes
import math
import mmap
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from sagittal.core.frames import Floats


def make_pages(*shape: int) -> Floats:
    """Zeros of a non-empty shape, in pages returned to the operating system once unreferenced.

    Pages never written to take no memory.
    """
    count = math.prod(shape)
    size = 8 * max(1, count)  # a map of nothing cannot be made
    if hasattr(mmap, "MAP_ANONYMOUS"):
        pages = mmap.mmap(-1, size, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    else:  # Windows
        pages = mmap.mmap(-1, size)
    return np.frombuffer(pages, np.float64, count).reshape(shape)


def give_memory_back() -> None:
    """Return freed memory to the operating system; no effect if the C library does not support it.

    glibc retains memory below allocations in use: 190 MB after reading an hour of seven sensors.
    """
    trim = _find_trim()
    if trim is not None:
        trim(0)


@lru_cache(maxsize=1)
def _find_trim() -> Callable[[int], int] | None:
    try:
        return ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):  # not glibc; Windows names no library so
        return None
