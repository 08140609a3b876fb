"""Squats, leg by leg: repetitions and what is measured on them, and how sure the angles are."""
