"""Memory that goes back to the machine: arrays with pages of their own, and what the C library keeps.

What the C library frees it keeps for the next array: large ones that die one after the other while another
one grows would be in memory together with it.
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
    """Zeros of a shape, not empty, whose memory goes back as soon as nobody holds them.

    What is never written takes none.
    """
    count = math.prod(shape)
    size = 8 * max(1, count)  # a map of nothing cannot be made
    if hasattr(mmap, "MAP_ANONYMOUS"):
        pages = mmap.mmap(-1, size, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    else:  # Windows
        pages = mmap.mmap(-1, size)
    return np.frombuffer(pages, np.float64, count).reshape(shape)


def give_memory_back() -> None:
    """Give freed memory back to the machine; where the C library cannot, nothing happens.

    glibc keeps what lies below memory that is in use: after reading an hour of seven sensors 190 MB.
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
