"""Inputs of L7S: gravity-free accelerations, orientations in Sy's frames, sample validity.

Every kernel carries its state across blocks, so that a file is one block and a stream is many.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numba
import numpy as np

from sagittal.core.body.l7s.filter import L7sInputs, Worn
from sagittal.core.body.l7s.legs import BODIES, LEGS, LegModel
from sagittal.core.errors import EstimationError
from sagittal.core.frames import FOOT, GRAVITY, Bools, Floats, Segment, Side
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.message import Message
from sagittal.core.rotation.compiled import multiply3, to_matrix, transform
from sagittal.core.signals.calibrated import CalibratedRecording, SegmentCalibration
from sagittal.core.signals.held_samples import SampleSeries
from sagittal.core.signals.recording import SensorSignals


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _write_free_acceleration(acc, valid, q, R, excess, out):  # type: ignore[no-untyped-def]
    """Write gravity-free accelerations (T, 3) of one sensor in W, 0 during data loss.

    Parameters
    ----------
    acc : (T, 3) as measured. valid : (T,). q : (T, 4) segment to W. R : (3, 3) sensor to segment. excess :
    norm at rest minus G, m/s².
    """
    force, turned = np.empty(3), np.empty((3, 3))
    for k in range(acc.shape[0]):
        out[k] = 0.0
        if not valid[k]:
            continue
        transform(R, acc[k], force)
        force[1] -= excess
        to_matrix(q[k], turned)
        transform(turned, force, out[k])
        out[k, 2] -= GRAVITY


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _write_sy_frames(q, back, out):  # type: ignore[no-untyped-def]
    """Write matrices (T, 3, 3) in Sy's frames for segments q (T, 4) in ours; `back` (3, 3) is Mᵀ."""
    R = np.empty((3, 3))
    for k in range(q.shape[0]):
        to_matrix(q[k], R)
        multiply3(R, back, out[k])


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _mark_known(valid, step, lost, is_known):  # type: ignore[no-untyped-def]
    """Write which samples (T,) are known; valid (T, n), the feet last; `lost` (2,) is advanced in place."""
    n = valid.shape[1]
    for k in range(valid.shape[0]):
        is_known[k] = True
        for i in range(n):
            if not valid[k, i]:
                is_known[k] = False
        for leg in range(2):
            if not valid[k, n - 2 + leg]:
                lost[leg] = True
            elif step[k, leg]:
                lost[leg] = False
            if lost[leg]:
                is_known[k] = False


class KnownSamples:
    """Samples with all sensors available and no foot still in swing after a data loss.

    Independent of the division into blocks.
    """

    def __init__(self) -> None:
        self._lost = np.zeros(len(LEGS), np.bool_)

    def push(self, valid: Sequence[Bools], step: Bools) -> Bools:
        """Process the next samples (T,).

        Parameters
        ----------
        valid : (T,) of each instrumented body in the order of `BODIES`. step : (T, 2) left and right foot
            still.
        """
        is_known = np.empty(len(step), np.bool_)
        _mark_known(np.stack(valid, axis=1), np.ascontiguousarray(step, np.bool_), self._lost, is_known)
        return is_known


def remove_gravity(acc: Floats, valid: Bools, q: Floats, mounted: SegmentCalibration) -> Floats:
    """Gravity-free accelerations (T, 3) of one sensor in W, m/s²; zero during data loss.

    The difference of the accelerometer's norm at rest from G is subtracted as a bias along the segment axis
    that is vertical at rest, not as a scale factor (docs/science/calibration.md, "Standing").

    Parameters
    ----------
    acc : (T, 3) specific force as measured, sensor axes, m/s². valid : (T,). q : (T, 4) segment to W.
    """
    out = np.empty((len(acc), 3))
    _write_free_acceleration(
        np.ascontiguousarray(acc),
        np.ascontiguousarray(valid),
        np.ascontiguousarray(q),
        np.array(mounted.R_segment_sensor),
        mounted.rest_norm - GRAVITY,
        out,
    )
    return out


def compile_gravity_kernel() -> None:
    """Compile the kernel of `remove_gravity` or load it from the cache, so that the first recording is not
    delayed.
    """
    mounted = SegmentCalibration(np.eye(3), np.zeros(3), GRAVITY, "declared", 1.0)
    valid = np.ones(1, np.bool_)
    valid.setflags(write=False)  # as that of a take
    remove_gravity(np.zeros((1, 3)), valid, np.array([[1.0, 0.0, 0.0, 0.0]]), mounted)


@dataclass(frozen=True, eq=False)
class FreeAcceleration:
    """Acceleration of one sensor as from `remove_gravity`, computed for the requested part only.

    Parameters
    ----------
    signals : of the sensor. q : (n, 4) segment to W.
    """

    signals: SensorSignals
    q: Floats
    mounted: SegmentCalibration

    def __getitem__(self, part: slice, /) -> Floats:
        return remove_gravity(
            self.signals.cut("acc", part), self.signals.valid[part], self.q[part], self.mounted
        )


def free_acceleration(
    calibrated: CalibratedRecording, orientations: Orientations
) -> dict[Segment, FreeAcceleration]:
    """Gravity-free accelerations of all sensors with an orientation."""
    mounted, sensors = calibrated.calibration.segments, calibrated.recording.sensors
    return {s: FreeAcceleration(sensors[s], q, mounted[s]) for s, q in orientations.q.items()}


def arrange_inputs(
    q: Mapping[Segment, Floats],
    acceleration: Mapping[Segment, Floats],
    step: Bools,
    model: LegModel,
    configuration: Worn,
) -> L7sInputs:
    """Convert orientations (T, 4) and accelerations (T, 3) of the instrumented bodies to the filter's order
    and frames.

    Parameters
    ----------
    step : (T, 2) left and right foot still.
    """
    R, acc = np.empty((len(step), 3, 3, 3)), np.zeros((len(step), 3, 3))
    R[:, 0] = np.eye(3)
    for b, segment in enumerate(BODIES):
        if segment in bodies_of(configuration):
            in_frame = np.empty((len(step), 3, 3))
            back = np.ascontiguousarray(model.to_isb(segment).T)
            _write_sy_frames(np.ascontiguousarray(q[segment]), back, in_frame)
            R[:, b], acc[:, b] = in_frame, acceleration[segment]
    if configuration == "2I":
        acc[:, 0] = 0.5 * (acc[:, 1] + acc[:, 2])
    return L7sInputs(R, acc, step, configuration)


def bodies_of(configuration: Worn) -> tuple[Segment, ...]:
    """Bodies of the state that carry a sensor."""
    return BODIES if configuration == "3I" else BODIES[1:]


@dataclass(frozen=True, eq=False)
class L7sTake:
    """The filter inputs of a recording, expanded only in parts: they take 290 bytes per sample.

    Parameters
    ----------
    step : (n, 2) left and right foot still.
    """

    q: Mapping[Segment, Floats]
    acceleration: Mapping[Segment, SampleSeries]
    step: Bools
    model: LegModel
    worn: Worn

    def part(self, which: slice) -> L7sInputs:
        """A slice of the samples."""
        needed = bodies_of(self.worn)
        return arrange_inputs(
            {s: self.q[s][which] for s in needed},
            {s: self.acceleration[s][which] for s in needed},
            self.step[which],
            self.model,
            self.worn,
        )


def take_of(
    orientations: Orientations,
    acceleration: Mapping[Segment, SampleSeries],
    steps: Mapping[Side, Bools],
    model: LegModel,
    configuration: Worn,
) -> L7sTake:
    """The filter inputs of a recording, accessible in parts.

    Raises
    ------
    EstimationError `sensor_missing` if an instrumented body has no orientation, acceleration or steps.
    """
    needed = bodies_of(configuration)
    for segment in needed:
        if segment not in orientations.q or segment not in acceleration:
            raise EstimationError(
                "sensor_missing",
                Message(
                    "L7S-{worn} requires {needed}; there is no data for {segment}. Attach or assign a sensor "
                    "there.",
                    worn=configuration,
                    needed=", ".join(needed),
                    segment=segment,
                ),
                sensor=segment,
            )
    for side in LEGS:
        if side not in steps:
            raise EstimationError(
                "sensor_missing",
                Message("L7S needs to know when the {side} foot is still; give its step flags.", side=side),
                sensor=FOOT[side],
            )
    step = np.stack([steps[side] for side in LEGS], axis=1)
    return L7sTake(orientations.q, acceleration, step, model, configuration)
