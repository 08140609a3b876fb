"""The live figure of pelvis and feet, or of feet alone, by L7S; distances from each foot's own ErKF."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numba
import numpy as np

from core.body.l7s.filter import L7sInputs, L7sParams, L7sState, L7sTrack, Worn, filter_block, start
from core.body.l7s.legs import BODIES, HIP_SIDE, LEGS, M_LEG, LegModel
from core.body.model import BodyModel
from core.calibration.result import SegmentCalibration
from core.errors import EstimationError, Notice
from core.estimators import L7S_2I, L7S_3I, LIVE_SINGLE_PATHS, LiveMethod
from core.frames import FOOT, GRAVITY, SHANK, THIGH, Bools, Segment
from core.online.body import FootPaths, Placed, Raw
from core.online.sparse_kernel import in_sy_frames, legs

FIGURE: Final[tuple[Segment, ...]] = (
    "pelvis",
    *(segment for side in LEGS for segment in (THIGH[side], SHANK[side], FOOT[side])),
)
"""Segments of the figure in the kernel's order."""

HIP_SIGN: Final = np.array([HIP_SIDE[side] for side in LEGS])


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _free(acc, valid, R, excess, q, out):  # type: ignore[no-untyped-def]
    """Write accelerations (T, 3) in W without gravity of one sensor, 0 where lost (`free_acceleration`)."""
    force = np.empty(3)
    for k in range(acc.shape[0]):
        for c in range(3):
            out[k, c] = 0.0
            force[c] = R[c, 0] * acc[k, 0] + R[c, 1] * acc[k, 1] + R[c, 2] * acc[k, 2]
        if not valid[k]:
            continue
        force[1] -= excess
        w, x, y, z = q[k]
        out[k, 0] = (1 - 2 * (y * y + z * z)) * force[0] + 2 * (x * y - w * z) * force[1]
        out[k, 0] += 2 * (x * z + w * y) * force[2]
        out[k, 1] = 2 * (x * y + w * z) * force[0] + (1 - 2 * (x * x + z * z)) * force[1]
        out[k, 1] += 2 * (y * z - w * x) * force[2]
        out[k, 2] = 2 * (x * z - w * y) * force[0] + 2 * (y * z + w * x) * force[1]
        out[k, 2] += (1 - 2 * (x * x + y * y)) * force[2] - GRAVITY


class Sparse:
    """Seven poses from three sensors or two."""

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
        self.attitudes: tuple[Segment, ...] = BODIES if self._worn == "3I" else BODIES[1:]
        self._column = {s: column[s] for s in self.attitudes}
        self._mounted = {s: mounted[s] for s in self.attitudes}
        self._model, self._rate_hz, self._params = LegModel.of(body), rate_hz, params or L7sParams()
        self._feet = feet
        self._to_foot = np.array(self._model.to_isb("foot_l"))
        self._back = {s: np.ascontiguousarray(self._model.to_isb(s).T) for s in self.attitudes}
        self._state: L7sState | None = None
        self._lost = np.zeros(len(LEGS), np.bool_)
        self._broken = False

    @property
    def broken(self) -> bool:
        """The filter gave up."""
        return self._broken or self._feet.broken

    def push(self, raw: Raw) -> Placed:
        """The next samples; the first block is the whole standing window."""
        paths = self._feet.push(raw)
        inputs = self._inputs(raw, paths.still & paths.valid)
        if self._state is None:
            self._state = start(inputs, self._model, self._params)
        track = self._filtered(inputs)
        T, x = len(inputs.step), self._model
        q, p = np.empty((T, len(FIGURE), 4)), np.empty((T, len(FIGURE), 3))
        legs(
            track.R,
            track.p,
            x.hip_width,
            x.thigh,
            x.shank,
            x.foot,
            HIP_SIGN,
            M_LEG.copy(),
            self._to_foot,
            q,
            p,
        )
        whole = np.asarray(self._known(raw, inputs.step) & np.isfinite(track.p[:, 0, 0]))
        return Placed(q, p, np.repeat(whole[:, None], len(FIGURE), axis=1), whole, paths)

    def told(self) -> list[Notice]:
        """What is new to be said of itself."""
        return []

    def _inputs(self, raw: Raw, step: Bools) -> L7sInputs:
        """As `inputs_of`."""
        T = len(raw.acc)
        R, acc = np.empty((T, 3, 3, 3)), np.zeros((T, 3, 3))
        R[:, 0] = np.eye(3)
        for b, segment in enumerate(BODIES):
            if segment not in self._column:
                continue
            i, mounted, q = self._column[segment], self._mounted[segment], raw.turned[segment]
            excess = mounted.rest_norm - GRAVITY
            free = np.empty((T, 3))
            _free(
                np.ascontiguousarray(raw.acc[:, i]), np.ascontiguousarray(raw.valid[:, i]),
                mounted.R_segment_sensor, excess, np.ascontiguousarray(q), free,
            )  # fmt: skip
            acc[:, b] = free
            turned = np.empty((T, 3, 3))
            in_sy_frames(np.ascontiguousarray(q), self._back[segment], turned)
            R[:, b] = turned
        if self._worn == "2I":
            acc[:, 0] = 0.5 * (acc[:, 1] + acc[:, 2])
        return L7sInputs(R, acc, step, self._worn)

    def _filtered(self, inputs: L7sInputs) -> L7sTrack:
        """The track of a block; NaN from the sample on at which the legs cannot be put together any more."""
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

    def _known(self, raw: Raw, step: Bools) -> Bools:
        """Samples (T,) at which every sensor is there and no foot is on its way after a loss."""
        known = np.logical_and.reduce([raw.valid[:, i] for i in self._column.values()])
        for leg, side in enumerate(LEGS):
            there = raw.valid[:, self._column[FOOT[side]]]
            for k in range(len(there)):
                if not there[k]:
                    self._lost[leg] = True
                elif step[k, leg]:
                    self._lost[leg] = False
                known[k] &= not self._lost[leg]
        return np.asarray(known)
