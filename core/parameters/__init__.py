"""Strides and angles → parameters and cycle curves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from core.angles import JointAngles
from core.events.result import Strides
from core.parameters.kinematic import (
    cycle_curves,
    foot_pitch,
    kinematic,
    mean_curve,
    per_stride_figures,
    stride_figures,
)
from core.parameters.result import Parameter
from core.parameters.temporal import per_stride, stride_values, temporal

if TYPE_CHECKING:
    # the package brings numba, which readers of results do without
    from core.fusion.orientations import Orientations

__all__ = [
    "cycle_curves",
    "foot_pitch",
    "gait_parameters",
    "kinematic",
    "mean_curve",
    "per_stride",
    "per_stride_figures",
    "stride_figures",
    "stride_values",
    "temporal",
]


def gait_parameters(
    strides: Strides, angles: JointAngles, orientations: Orientations | None = None
) -> tuple[Parameter, ...]:
    """All parameters of a take: temporal, then angles over the cycle, then foot pitch at the contacts.

    Parameters
    ----------
    orientations : of the feet, for their pitch; None leaves it out.
    """
    pitch = None if orientations is None else foot_pitch(orientations, strides)
    return temporal(strides) + kinematic(cycle_curves(angles, strides), pitch)
