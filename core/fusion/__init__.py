"""CalibratedRecording → Orientations: the attitude of each sensor, then relative headings without drift."""
