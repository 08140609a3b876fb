"""Sensors of a live recording that do not measure: the rule of core/quality/stuck.py on the live axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sagittal.core.errors import Notice
from sagittal.core.frames import Segment
from sagittal.core.quality.stuck import StuckParams, StuckWatch
from sagittal.core.quality.stuck_kernel import CLIPPED
from sagittal.core.timeline.live import UniformBlock


class StuckSensors:
    """Invalidates samples of sensors that do not measure, and reports each such sensor once.

    Parameters
    ----------
    segments : in the order of the block columns.
    """

    def __init__(
        self, segments: Sequence[Segment], rate_hz: float, params: StuckParams | None = None
    ) -> None:
        self._segments, self._rate_hz = tuple(segments), rate_hz
        self._watch = StuckWatch(len(self._segments), rate_hz, params)
        self._told: set[tuple[int, int]] = set()
        self.now: tuple[Segment, ...] = ()
        """Segments whose sensor does not measure at the last sample."""

    def push(self, block: UniformBlock) -> tuple[UniformBlock, list[Notice]]:
        """Process the next samples; returns the block with invalid samples marked, and new notices."""
        faults = self._watch.push(block.acc, block.gyr, block.valid)
        if faults is None:
            self.now = ()
            none = np.zeros(block.valid.shape, np.bool_)
            x = block  # `replace` looks at every field, in every push
            return UniformBlock(x.first, x.t_s, x.acc, x.gyr, x.valid, x.interpolated, none), []
        bad, back = faults
        self.now = tuple(s for s, x in zip(self._segments, bad[-1], strict=True) if x)
        notices = []
        for k, i in np.argwhere(back > 0).tolist():
            fault = int(bad[k, i])
            if (i, fault) not in self._told:
                self._told.add((i, fault))
                first_s = (block.first + k - int(back[k, i])) / self._rate_hz
                notices.append(self._watch.describe(self._segments[i], i, fault, first_s))
        measured = bad == 0
        block = replace(
            block,
            valid=block.valid & measured,
            interpolated=block.interpolated & measured,
            out=~measured & (bad <= CLIPPED),
        )
        return block, notices
