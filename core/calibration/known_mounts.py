"""Calibration of a recording with known sensor alignment: find its rest, and verify the alignment.

An alignment that differs from the protocol would give wrong angles without any sign of it. In standing the
long axis of a segment is about vertical; in a squat thigh and shank rotate about the axis to the right, the
shank forward and the thigh backward.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import acos, degrees, radians
from typing import Final

import numpy as np

from sagittal.core.calibration.standing import GOOD_S, LONGEST_S, find_rests, stand_all
from sagittal.core.calibration.standing_leg import find_standing_legs
from sagittal.core.errors import CalibrationError, SignalError
from sagittal.core.frames import SHANK, SIDES, THIGH, Floats, Segment, Side
from sagittal.core.message import Message
from sagittal.core.signals.calibrated import CalibratedRecording, Calibration, SegmentCalibration
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import RestParams, index_window

OFF: Final = radians(35.0)
"""From here on a mounting is not the one agreed on (our choice: people lean, knees bend aside, by less)."""

FIXED_OFFSET: Final = 0.5
TABLE_TOP: Final = 0.8
"""Scores of the two protocols: nobody measured the first, the second drifts by a degree (our choice)."""

BENDING: Final = radians(10.0)
"""RMS rate in rad/s from which a segment shows the axis that it turns about (our choice)."""

LEANS: Final = radians(15.0)
"""So far a thigh or shank leans in a squat at least (our choice)."""

FORWARD: Final[Mapping[Segment, float]] = {
    **dict.fromkeys(SHANK.values(), -1.0),
    **dict.fromkeys(THIGH.values(), 1.0),
}
"""Sign of the tilt about the axis to the right in a squat: shins lean forward, thighs back."""

SIDE_OF: Final[Mapping[Segment, Side]] = {s: side for side in SIDES for s in (SHANK[side], THIGH[side])}


def calibrate_with_mounts(
    recording: UniformRecording,
    mounts: Mapping[Segment, Floats],
    method: str,
    score: float,
    params: RestParams | None = None,
    after_s: float = 0.0,
) -> CalibratedRecording:
    """Use known alignments, and take biases, gravity norms and the zero of angles from the first standing.

    The first rest of 2 s or more, else the longest; of it the last 8 s, before movement starts.

    Parameters
    ----------
    mounts : segment → (3, 3) R_segment_sensor. method : their origin: "fixed_offset", "table_top".
    score : their certainty, as `SegmentCalibration.score`: `FIXED_OFFSET`, `TABLE_TOP`.
    after_s : earlier rests are ignored, because the sensors are not yet on the body.

    Raises
    ------
    CalibrationError `no_segment` if no sensor of the recording has a known alignment,
    `mounting_not_as_agreed`. SignalError `no_rest`, `rest_too_short`, `not_still`, `unit_suspect`.
    """
    params = params or RestParams()
    mounted_segments = [s for s in mounts if s in recording.sensors]
    if not mounted_segments:
        raise CalibrationError(
            "no_segment",
            Message(
                "Placements are known for {mounts}; the trial has {sensors}.",
                mounts=", ".join(mounts),
                sensors=", ".join(recording.sensors),
            ),
        )
    candidates = find_rests(recording, params)
    rests = tuple((max(r[0], after_s), r[1]) for r in candidates if r[1] - params.shortest_s >= after_s)
    if not rests:
        raise SignalError("no_rest", "No quiet standing detected with the sensors attached.", t_s=after_s)
    chosen = next((r for r in rests if r[1] - r[0] >= GOOD_S), None) or max(rests, key=lambda r: r[1] - r[0])
    zero = (max(chosen[0], chosen[1] - LONGEST_S), chosen[1])
    standing = stand_all(recording, zero, rests, params)
    calibration = Calibration(
        segments={
            s: SegmentCalibration(
                R_segment_sensor=np.asarray(mounts[s], np.float64),
                gyro_bias=standing[s].gyro_bias,
                rest_norm=standing[s].rest_norm,
                method=method,
                score=score,
            )
            for s in mounted_segments
        },
        rest=rests,
        walking=(),
        zero=zero,
        turning=np.zeros(len(recording.t_s), bool),
        method=method,
    )
    calibrated = CalibratedRecording(recording, calibration)
    _check_mounts(calibrated)
    return calibrated


def _check_mounts(calibrated: CalibratedRecording) -> None:
    """Reject an alignment that standing or movement contradicts; a lifted leg is not checked."""
    recording, zero = calibrated.recording, calibrated.calibration.zero
    stands = find_standing_legs(calibrated)
    standing = index_window(zero, recording.rate_hz)
    for segment, mounted in calibrated.calibration.segments.items():
        signals, R = recording.sensors[segment], mounted.R_segment_sensor
        up = R @ signals.acc[standing][signals.valid[standing]].mean(axis=0)
        lean = acos(float(np.clip(up[1] / np.linalg.norm(up), -1.0, 1.0)))
        if lean > OFF:
            raise _refuse(
                segment,
                Message(
                    "its long axis is {lean:.0f}° off the vertical during quiet standing", lean=degrees(lean)
                ),
            )
        if segment not in FORWARD:
            continue
        side = SIDE_OF[segment]
        movement = signals.valid & stands[side] if side in stands else signals.valid.copy()
        movement[: standing.stop] = False
        rate, force = ((x[movement] @ R.T) for x in (signals.gyr - mounted.gyro_bias, signals.acc))
        if len(rate) < 3 or float(np.sqrt(np.mean((rate**2).sum(axis=1)))) < BENDING:
            continue
        axis = np.linalg.eigh(rate.T @ rate)[1][:, -1]
        turned = acos(float(min(1.0, abs(axis[2]))))
        if turned > OFF:
            raise _refuse(
                segment,
                Message("its flexion axis is {turned:.0f}° off the specified one", turned=degrees(turned)),
            )
        low, high = np.percentile(FORWARD[segment] * np.arctan2(force[:, 0], force[:, 1]), (2.0, 98.0))
        stood = FORWARD[segment] * float(np.arctan2(up[0], up[1]))
        if stood - low > high - stood and stood - low > LEANS:
            raise _refuse(
                segment, "it tilts in the wrong direction in squats, so it is attached the other way round"
            )


def _refuse(segment: Segment, problem: str) -> CalibrationError:
    return CalibrationError(
        "mounting_not_as_agreed",
        Message(
            "{segment}: {what}; limit {OFF:.0f}°. Attach the sensor as specified in the protocol, or "
            "calibrate from the table.",
            segment=segment,
            what=problem,
            OFF=degrees(OFF),
        ),
        sensor=segment,
    )
