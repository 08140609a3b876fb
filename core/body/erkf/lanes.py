"""Several numbers of a row at a time in compiled loops: eight, or one where Numba was not tested with eight.

LLVM does so on its own where it can prove that what is written is not what is read. Of rows of one covariance
it can not: it asks before every loop, and loops here are a dozen lines of the cache long. Same operations in
the same order, so the same bits with either.
"""

from __future__ import annotations

from typing import Final

from sagittal.core.signals.inner import IS_TESTED

if IS_TESTED:
    from sagittal.core.body.erkf.vector_lanes import (
        STEP,
        mix,
        read_columns,
        read_lanes,
        spread,
        write_columns,
        write_lanes,
    )
else:
    from sagittal.core.body.erkf.plain_lanes import (
        STEP,
        mix,
        read_columns,
        read_lanes,
        spread,
        write_columns,
        write_lanes,
    )

__all__ = ["IN_LINE", "STEP", "mix", "read_columns", "read_lanes", "spread", "write_columns", "write_lanes"]

IN_LINE: Final = 8
"""Numbers in one line of the processor's cache, to which rows are filled up; columns of `read_columns`."""
