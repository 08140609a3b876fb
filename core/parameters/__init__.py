"""Strides and angles → parameters and cycle curves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from core.angles import JointAngles
from core.events.result import Strides
from core.frames import Oriented
from core.parameters.kinematic import (
    cycle_curves,
    foot_pitch,
    kinematic,
    mean_curve,
    per_stride_figures,
    stride_figures,
)
from core.parameters.result import Parameter
from core.parameters.spatial import GROUND, Surface, per_stride_spatial, spatial, spatial_rows, surface_of
from core.parameters.temporal import per_stride, stride_values, temporal

if TYPE_CHECKING:
    # the package brings numba, which readers of results do without
    from core.body.feet import FootTracks

__all__ = [
    "Surface",
    "cycle_curves",
    "foot_pitch",
    "gait_parameters",
    "kinematic",
    "mean_curve",
    "per_stride",
    "per_stride_figures",
    "per_stride_spatial",
    "spatial_rows",
    "stride_figures",
    "stride_values",
    "surface_of",
    "temporal",
]


def gait_parameters(
    strides: Strides,
    angles: JointAngles,
    orientations: Oriented | None = None,
    feet: FootTracks | None = None,
    surface: Surface = GROUND,
) -> tuple[Parameter, ...]:
    """All parameters of a take: temporal, spatial, angles over the cycle, foot pitch at the contacts.

    Parameters
    ----------
    orientations : of the feet, for their pitch; None leaves it out. feet : None = there are no distances.
    """
    pitch = None if orientations is None else foot_pitch(orientations, strides)
    rows = spatial_rows(strides, feet, surface)
    return (
        temporal(strides)
        + spatial(strides, feet, rows, surface)
        + kinematic(cycle_curves(angles, strides), pitch)
    )
