"""Segment lengths of the lower body."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BodyModel:
    """Lengths in m.

    Parameters
    ----------
    hip_width : between hip centres. thigh : hip to knee centre. shank : knee to ankle centre.
    ankle_height : ankle centre above the sole. foot : heel to toe.
    estimated : True when taken from body height by Winter's fractions, False when measured.
    """

    hip_width: float
    thigh: float
    shank: float
    ankle_height: float
    foot: float
    estimated: bool
