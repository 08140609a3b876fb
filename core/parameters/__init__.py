"""Strides and angles → parameters and cycle curves."""

from __future__ import annotations

from sagittal.core.parameters.kinematic import (
    cycle_curves,
    foot_pitch,
    mean_curve,
    per_stride_figures,
    stride_figures,
    summarise_angles,
)
from sagittal.core.parameters.spatial import Surface, measure_distances, surface_of
from sagittal.core.parameters.take import TakeFigures, gait_parameters, take_figures
from sagittal.core.parameters.temporal import per_stride, stride_values, summarise_times

__all__ = [
    "Surface",
    "TakeFigures",
    "cycle_curves",
    "foot_pitch",
    "gait_parameters",
    "mean_curve",
    "measure_distances",
    "per_stride",
    "per_stride_figures",
    "stride_figures",
    "stride_values",
    "summarise_angles",
    "summarise_times",
    "surface_of",
    "take_figures",
]
