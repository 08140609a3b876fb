"""Poses → viser scene, one server per view, behind our proxy."""
