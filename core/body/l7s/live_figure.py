"""Live poses of pelvis and feet, or of feet alone, by L7S; distances from a separate ErKF per foot."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sagittal.core.body.erkf.live_sensors import FootPaths
from sagittal.core.body.l7s.filter import (
    L7sInputs,
    L7sParams,
    L7sState,
    L7sTrack,
    Worn,
    filter_block,
    start_l7s_state,
)
from sagittal.core.body.l7s.inputs import KnownSamples, arrange_inputs, bodies_of, remove_gravity
from sagittal.core.body.l7s.legs import FIGURE, LegModel, solve_legs
from sagittal.core.body.live_estimator import BodyBlock, MeasuredBlock
from sagittal.core.body.model import BodyModel
from sagittal.core.errors import EstimationError, Notice
from sagittal.core.estimators import L7S_2I, L7S_3I, LIVE_SINGLE_PATHS, LiveMethod
from sagittal.core.frames import Bools, Segment
from sagittal.core.signals.calibrated import SegmentCalibration


class LiveL7s:
    """Poses of seven segments from three sensors or two."""

    segments: tuple[Segment, ...] = FIGURE
    linked = False
    source = LIVE_SINGLE_PATHS

    def __init__(
        self,
        column: Mapping[Segment, int],
        mounted: Mapping[Segment, SegmentCalibration],
        body: BodyModel,
        rate_hz: float,
        feet: FootPaths,
        params: L7sParams | None = None,
    ) -> None:
        self._worn: Worn = "3I" if "pelvis" in column else "2I"
        self.method: LiveMethod = (L7S_3I if self._worn == "3I" else L7S_2I).name
        self.attitudes: tuple[Segment, ...] = bodies_of(self._worn)
        self._column = {s: column[s] for s in self.attitudes}
        self._mounted = {s: mounted[s] for s in self.attitudes}
        self._model, self._rate_hz, self._params = LegModel.of(body), rate_hz, params or L7sParams()
        self._feet = feet
        self._state: L7sState | None = None
        self._known = KnownSamples()
        self._broken = False

    @property
    def broken(self) -> bool:
        """Whether the filter has failed."""
        return self._broken or self._feet.broken

    def push(self, raw: MeasuredBlock) -> BodyBlock:
        """Process the next samples; the first block is the whole standing window."""
        paths = self._feet.push(raw)
        inputs = self._inputs(raw, paths.still & paths.valid)
        if self._state is None:
            self._state = start_l7s_state(inputs, self._model, self._params)
        track = self._filtered(inputs)
        legs = solve_legs(track.R, track.p, self._model)
        valid = [raw.valid[:, i] for i in self._column.values()]
        whole = np.asarray(self._known.push(valid, inputs.step) & np.isfinite(track.p[:, 0, 0]))
        return BodyBlock(legs.q, legs.p, np.repeat(whole[:, None], len(FIGURE), axis=1), whole, paths)

    def drain_notices(self) -> list[Notice]:
        """New notices; always empty."""
        return []

    def _inputs(self, raw: MeasuredBlock, step: Bools) -> L7sInputs:
        acceleration = {
            s: remove_gravity(raw.acc[:, i], raw.valid[:, i], raw.turned[s], self._mounted[s])
            for s, i in self._column.items()
        }
        return arrange_inputs(raw.turned, acceleration, step, self._model, self._worn)

    def _filtered(self, inputs: L7sInputs) -> L7sTrack:
        """The track of a block; NaN from the sample on at which the leg constraints cannot be satisfied."""
        T = len(inputs.step)
        whole = L7sTrack(
            np.full((T, 3, 3, 3), np.nan), np.full((T, 3, 3), np.nan), np.full((T, 3, 3), np.nan),
            np.full((T, 27), np.nan),
        )  # fmt: skip
        if self._broken or self._state is None:
            return whole
        try:
            track, self._state = filter_block(self._state, inputs, self._model, self._rate_hz, self._params)
        except EstimationError:
            # again one by one: what is before the failure must not depend on the block
            for k in range(T):
                one = slice(k, k + 1)
                try:
                    track, self._state = filter_block(
                        self._state, inputs.part(one), self._model, self._rate_hz, self._params
                    )
                except EstimationError:
                    self._broken = True
                    break
                for name, value in vars(track).items():
                    getattr(whole, name)[one] = value
            return whole
        return track
