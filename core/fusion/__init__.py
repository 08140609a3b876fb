"""CalibratedRecording → Orientations: the attitude of each sensor, then drift-free relative headings."""
