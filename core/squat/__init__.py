"""Squats on one leg: repetitions and what is measured on them, and how sure the angles are."""
