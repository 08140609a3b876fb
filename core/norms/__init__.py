"""Reference tables (package data) and their lookup."""

from core.norms.adults import adult_reference
from core.norms.kinematics import NormBand, NormBands, adult_kinematics
from core.norms.lookup import Norms, norms_for
from core.norms.place import Place
from core.norms.values import NormValue, NormValues, angle_values, expected_at_speed, temporal_values

__all__ = [
    "NormBand",
    "NormBands",
    "NormValue",
    "NormValues",
    "Norms",
    "Place",
    "adult_kinematics",
    "adult_reference",
    "angle_values",
    "expected_at_speed",
    "norms_for",
    "temporal_values",
]
