"""Gait of a simulated person: feet, pelvis, legs, timing, soft tissue."""
