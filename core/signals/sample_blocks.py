"""A sensor's recording that is too long to hold: samples block by block, as often as asked.

How long the blocks are says nothing: who reads them gives the same result however they are cut.
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
    """Successive samples of one sensor.

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
    """One sensor whose samples are read when somebody goes through them.

    Parameters
    ----------
    rate_hz : nominal. duration_s : from first to last sample as the file declares it.
    started_at : the device's own clock at the first sample, None without one.
    open_blocks : begins at the first sample, every time it is called.
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
    """The rows of a block in which every channel was measured.

    An acceleration of exactly zero on all axes is what a device writes when it does not measure.
    """
    good = is_complete(block.acc) & block.acc.any(axis=1)
    if block.gyr is not None:
        good = good & is_complete(block.gyr)
    if good.all():
        return block
    return SampleBlock(block.t_s[good], block.acc[good], None if block.gyr is None else block.gyr[good])
