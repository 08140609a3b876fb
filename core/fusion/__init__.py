"""CalibratedRecording → Orientations."""
