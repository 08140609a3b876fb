"""UniformRecording → CalibratedRecording: sensor-to-segment orientation, gyro bias, heading."""
