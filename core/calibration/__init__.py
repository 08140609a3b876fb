"""UniformRecording → CalibratedRecording: sensor-to-segment orientation, gyro bias, heading."""

from sagittal.core.calibration.calibrate import CalibrationParams, calibrate

__all__ = ["CalibrationParams", "calibrate"]
