"""Arrays with pages of their own, which the machine has back as soon as nobody holds them.

What the C library frees it keeps for the next array: large ones that die one after the other while another
one grows would be in memory together with it.
"""

from __future__ import annotations

import math
import mmap

import numpy as np

from core.frames import Floats


def make_pages(*shape: int) -> Floats:
    """Zeros of a shape, not empty."""
    size = 8 * math.prod(shape)
    if hasattr(mmap, "MAP_ANONYMOUS"):
        pages = mmap.mmap(-1, size, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    else:  # Windows
        pages = mmap.mmap(-1, size)
    return np.frombuffer(pages, np.float64).reshape(shape)
