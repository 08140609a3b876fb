"""UniformRecording → CalibratedRecording: sensor-to-segment alignment, gyro bias, heading."""

from sagittal.core.calibration.calibrate import CalibrationParams, calibrate

__all__ = ["CalibrationParams", "calibrate"]
