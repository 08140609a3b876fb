"""Orientations → gait events and the stride list."""
