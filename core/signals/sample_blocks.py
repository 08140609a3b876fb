"""A sensor recording too long for memory: samples block by block, as often as requested.

Block lengths are arbitrary: readers must give the same result for any division.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from sagittal.core.errors import Notice
from sagittal.core.frames import Floats
from sagittal.core.signals.held_samples import is_complete


@dataclass(frozen=True, eq=False)
class SampleBlock:
    """Consecutive samples of one sensor.

    Parameters
    ----------
    t_s : (n,) seconds from the recording's first sample. acc : (n, 3) specific force, m/s²; NaN = missing.
    gyr : (n, 3) rad/s, None without a gyroscope.
    """

    t_s: Floats
    acc: Floats
    gyr: Floats | None


@dataclass(frozen=True, eq=False)
class LongStream:
    """One sensor whose samples are read on iteration.

    Parameters
    ----------
    rate_hz : nominal. duration_s : from first to last sample as declared by the file.
    started_at : the device's own clock at the first sample, None without one.
    open_blocks : starts at the first sample in every call.
    """

    device_id: str
    source: str
    rate_hz: float
    has_gyro: bool
    duration_s: float
    open_blocks: Callable[[], Iterator[SampleBlock]]
    started_at: dt.datetime | None = None
    notices: tuple[Notice, ...] = field(default=())


def find_complete_rows(block: SampleBlock) -> SampleBlock:
    """The rows of a block with all channels measured.

    An acceleration of exactly zero on all axes is written by devices when they do not measure.
    """
    good = is_complete(block.acc) & block.acc.any(axis=1)
    if block.gyr is not None:
        good = good & is_complete(block.gyr)
    if good.all():
        return block
    return SampleBlock(block.t_s[good], block.acc[good], None if block.gyr is None else block.gyr[good])
