"""Timed functional tests and quiet standing, measured with one sensor on the trunk."""
