"""The default engine: Mahony 2008, six axes, gyro bias fixed from rest, started from standing.

In standing every segment faces forward by convention, so the calibration itself gives the initial state: the
sensor's orientation in W at rest is R_neutral R_segment_sensor. From there the filter of attitude.py runs to
both ends of the recording. The remaining error is rotation about the vertical, which accelerometers cannot
observe; drift.py handles it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from sagittal.core.errors import EstimationError
from sagittal.core.frames import R_NEUTRAL, Bools, Floats, Segment
from sagittal.core.fusion.attitude import AttitudeParams, estimate_orientation
from sagittal.core.fusion.drift import DriftParams, remove_relative_drift
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import conjugate, from_matrix, multiply
from sagittal.core.signals.calibrated import CalibratedRecording, SegmentCalibration
from sagittal.core.signals.held_samples import HeldSeries, cut_blocks
from sagittal.core.signals.recording import SensorSignals
from sagittal.core.signals.rest import Window


@dataclass(frozen=True)
class MahonyParams:
    """Parameters of the engine."""

    attitude: AttitudeParams = field(default_factory=AttitudeParams)
    drift: DriftParams = field(default_factory=DriftParams)


def estimate_orientations(
    calibrated: CalibratedRecording, params: MahonyParams | None = None
) -> Orientations:
    """Orientation of every calibrated segment in the common world W (x = facing at standing).

    Parameters
    ----------
    calibrated : any subset of segments.

    Returns
    -------
    Orientations with `valid` False where a sensor was lost; a notice `heading_rereferenced` with the amount
    of relative heading drift removed.

    Raises
    ------
    EstimationError `no_segment` without a calibrated segment, `filter_diverged` on non-finite samples.
    """
    params = params or MahonyParams()
    recording, calibration = calibrated.recording, calibrated.calibration
    if not calibration.segments:
        raise EstimationError("no_segment", "No segment is calibrated; calibrate at least one foot.")
    q: dict[Segment, Floats] = {}
    valid: dict[Segment, Bools] = {}
    for segment, mounted in calibration.segments.items():
        signals = recording.sensors[segment]
        q[segment] = segment_orientation(
            signals, mounted, calibration.zero, recording.rate_hz, params.attitude
        )
        valid[segment] = signals.valid
    q, drift, drift_notices = remove_relative_drift(q, valid, calibration, recording.rate_hz, params.drift)
    return Orientations(
        t_s=recording.t_s,
        rate_hz=recording.rate_hz,
        q=q,
        valid=valid,
        engine="mahony",
        notices=tuple(drift_notices),
        diagnostics={"kp": params.attitude.kp, "largest_drift_rad": drift},
    )


def segment_orientation(
    signals: SensorSignals, mounted: SegmentCalibration, zero: Window, rate_hz: float, params: AttitudeParams
) -> Floats:
    """Orientation (n, 4) of one segment in W, from `zero` to both ends of the recording."""
    start = mounted.start_q
    if start is None:
        start = from_matrix(R_NEUTRAL @ mounted.R_segment_sensor)
    middle = min(round(0.5 * (zero[0] + zero[1]) * rate_hz), len(signals.valid) - 1)
    gyr, acc = HeldSeries(signals, "gyr", mounted.gyro_bias), HeldSeries(signals, "acc")
    q = estimate_orientation(start, middle, gyr, acc, signals.valid, rate_hz, mounted.rest_norm, params)
    back = conjugate(from_matrix(mounted.R_segment_sensor))
    for part in cut_blocks(len(q)):
        q[part] = multiply(q[part], back)
    return q
