"""Temporary clinic of `sagittal demo`: simulated patients, one of whom walks live."""
