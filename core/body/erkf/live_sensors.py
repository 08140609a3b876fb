"""Sensors of a live recording through gap bridging, stillness detection and ErKF, and the paths of the
feet.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from sagittal.core.body.erkf.gaps import GapBridge
from sagittal.core.body.erkf.live_erkf import LiveErkf, SignalBlock
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.live_estimator import FootBlock, MeasuredBlock
from sagittal.core.body.live_still import StillnessDetector
from sagittal.core.body.model import BodyModel
from sagittal.core.body.tree import person_tree
from sagittal.core.frames import GRAVITY, R_NEUTRAL, Floats, Segment
from sagittal.core.rotation import from_matrix, multiply
from sagittal.core.signals.calibrated import SegmentCalibration
from sagittal.core.signals.rest import count_runs
from sagittal.core.timeline.columns import find_columns, take_columns, take_mask


class FilteredBlock(NamedTuple):
    """Filtered signals; q (T, n, 4), p (T, n, 3) segment origins; (T, joints) distances of the joint ends,
    m.
    """

    signals: SignalBlock
    q: Floats
    p: Floats
    residual: Floats


class FilteredSensors:
    """Some sensors through gap bridging, stillness detection and ErKF; the first block is the whole standing
    window.

    Parameters
    ----------
    segments : of these sensors, all calibrated. column : segment → index among the chain's sensors.
    """

    def __init__(
        self,
        segments: Sequence[Segment],
        column: Mapping[Segment, int],
        mounted: Mapping[Segment, SegmentCalibration],
        body: BodyModel,
        rate_hz: float,
        params: ErkfParams,
    ) -> None:
        mounts = {s: mounted[s].R_segment_sensor for s in segments}
        self.tree = person_tree(body, mounts, segments)
        self._columns = find_columns(segments, sorted(column, key=lambda s: column[s]))
        excess = [(mounted[s].rest_norm - GRAVITY) * mounts[s][1] for s in segments]
        bias = [mounted[s].gyro_bias for s in segments]
        self._bridge = GapBridge(self.tree, np.array(excess), np.array(bias), rate_hz)
        self._still = StillnessDetector(len(segments), rate_hz)
        self._filled = np.zeros(len(segments), np.int64)
        self._rate_hz, self._params = rate_hz, params
        # by convention all segments face ahead while standing (core/fusion/mahony.py)
        self._start = multiply(from_matrix(R_NEUTRAL), self.tree.q_mount)
        self._filter: LiveErkf | None = None

    @property
    def broken(self) -> bool:
        """Whether the filter has failed."""
        return self._filter is not None and self._filter.broken

    def push(self, raw: MeasuredBlock) -> FilteredBlock:
        """Process the next samples."""
        measured_acc, measured_gyr, valid = take_columns(raw.acc, raw.gyr, raw.valid, self._columns)
        acc, gyr = self._bridge.push(measured_acc, measured_gyr, valid)
        filled = take_mask(raw.filled, self._columns)
        # as `find_patches` of a file, but for the first sample of each: it is not known yet how long it gets
        patched = filled & ((count_runs(filled, self._filled) + 1) / self._rate_hz > self._params.patch_s)
        signals = SignalBlock(acc, gyr, valid, self._still.push(acc, gyr, valid), patched)
        if self._filter is None:
            self._filter = LiveErkf(self.tree, self._params, self._rate_hz, signals, self._start)
        states, residual = self._filter.push(signals)
        q, p = self.tree.segments(states[..., :3], states[..., 6:10])
        return FilteredBlock(signals, q, p, residual)


class FootPaths:
    """Paths of feet, each from its own sensor: used for distances if no chain links them."""

    def __init__(self, filtered: FilteredSensors) -> None:
        self._filtered = filtered

    @property
    def broken(self) -> bool:
        """Whether the filter has failed."""
        return self._filtered.broken

    def push(self, raw: MeasuredBlock) -> FootBlock:
        """Process the next samples."""
        x = self._filtered.push(raw)
        valid = x.signals.valid & np.isfinite(x.p[:, :, 0])
        still = np.ascontiguousarray(x.signals.still[:, :, 0])
        return FootBlock(x.p, x.q, still, valid, x.signals.patched & ~still)
