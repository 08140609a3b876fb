"""Reference tables (package data) and their lookup."""

from core.norms.kinematics import NormBand, NormBands, adult_kinematics
from core.norms.values import (
    NormValue,
    NormValues,
    angle_values,
    expected_at_speed,
    gps_reference,
    temporal_values,
)

__all__ = [
    "NormBand",
    "NormBands",
    "NormValue",
    "NormValues",
    "adult_kinematics",
    "angle_values",
    "expected_at_speed",
    "gps_reference",
    "temporal_values",
]
