"""Analyses, edits, comparisons, prescriptions and other results."""
