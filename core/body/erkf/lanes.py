"""Several numbers of a row at once in compiled loops: eight, or one with Numba versions not tested with
eight.

LLVM vectorises on its own where it can prove that written and read memory do not overlap. For rows of one
covariance it cannot: it inserts a check before every loop, and loops here are only a dozen cache lines long.
Both variants perform the same operations in the same order and give bit-identical results.
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
