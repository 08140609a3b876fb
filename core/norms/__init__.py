"""Reference tables (package data) and their lookup."""

from sagittal.core.norms.adults import adult_reference, adult_reference_at_speed
from sagittal.core.norms.kinematics import NormBand, NormBands, adult_kinematics
from sagittal.core.norms.lookup import Norms, look_up_norms
from sagittal.core.norms.place import NormPlacement
from sagittal.core.norms.values import NormValue, NormValues, angle_values, predict_at_speed, temporal_values

__all__ = [
    "NormBand",
    "NormBands",
    "NormPlacement",
    "NormValue",
    "NormValues",
    "Norms",
    "adult_kinematics",
    "adult_reference",
    "adult_reference_at_speed",
    "angle_values",
    "look_up_norms",
    "predict_at_speed",
    "temporal_values",
]
