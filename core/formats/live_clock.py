"""Common time of the streams of a live recording: the same rule while it runs and when its log is read.

Streams on the shared clock tick together. For a stream on its own clock only the sending time of its samples
is known: the smallest (sent − sampled) of its first second is taken as the delay of all its samples, since
the batch with the least delay bounds it best. The transmission delay itself (some 10 ms by Bluetooth)
remains, equally in all streams of a kind.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.formats.live_hello import Hello
from sagittal.core.formats.live_log import SampleBatch

SETTLING_US: Final = 1_000_000
"""Samples of a clock by which it is aligned."""

Micros = NDArray[np.int64]


def sample_times_us(batch: SampleBatch, rate_hz: float) -> Micros:
    """Device time (n,) of a batch's samples: from its offsets, else evenly spaced by the stream's rate."""
    if batch.offsets_us is not None:
        return batch.t0_us + batch.offsets_us.astype(np.int64)
    return batch.t0_us + _steps_us(len(batch.samples), rate_hz)


@lru_cache(maxsize=64)
def _steps_us(samples: int, rate_hz: float) -> Micros:
    """Time (n,) since the first of some evenly spaced samples; cached, because batches of a stream have
    few sizes.
    """
    steps: Micros = np.rint(np.arange(samples) * (1e6 / rate_hz)).astype(np.int64)
    steps.setflags(write=False)
    return steps


@dataclass
class _Group:
    """Streams on one clock: time of the first sample, smallest delay so far, whether it is final."""

    first_us: int | None = None
    offset_us: int | None = None
    settled: bool = False


class LiveClock:
    """Offsets from each stream's device clock to the common one; the batches are pushed in order.

    With a single clock there is nothing to align and the offset is 0.
    """

    def __init__(self, hello: Hello) -> None:
        shared = _Group()
        self._groups = {s.stream: shared if s.clock == "shared" else _Group() for s in hello.streams}
        self.single = len({id(g) for g in self._groups.values()}) == 1

    def push(self, stream: int, first_us: int, last_us: int, sent_us: int) -> None:
        """Register when the first and last sample of a batch were taken, and when it was sent."""
        group = self._groups[stream]
        if group.settled:
            return
        if group.first_us is None:
            group.first_us = first_us
        age = last_us - group.first_us
        if group.offset_us is None:
            group.offset_us = sent_us - last_us
        elif age <= SETTLING_US:
            group.offset_us = min(group.offset_us, sent_us - last_us)
        group.settled = age >= SETTLING_US

    def offset_us(self, stream: int, *, final: bool = True) -> int | None:
        """Offset to add to a stream's device clock; None during its first second.

        Parameters
        ----------
        final : False = estimate from the batches so far, for a stream that ended within its first second.
        """
        return 0 if self.single else self.sender_offset_us(stream, final=final)

    def sender_offset_us(self, stream: int, *, final: bool = True) -> int | None:
        """The same relative to the sender's clock, also with a single clock."""
        group = self._groups[stream]
        return group.offset_us if group.settled or not final else None
