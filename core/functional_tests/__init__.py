"""Timed functional tests and quiet standing, measured by one sensor on the trunk."""
