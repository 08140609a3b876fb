"""All parameters of a take, and of every stride of its list: each measured once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from core.angles import JointAngles
from core.events.result import Strides
from core.frames import Floats, Oriented, Side
from core.parameters.kinematic import cycle_curves, foot_pitch, kinematic, per_stride_figures, stride_figures
from core.parameters.result import Parameter
from core.parameters.spatial import GROUND, Surface, per_stride_spatial, spatial, spatial_rows
from core.parameters.temporal import Column, per_stride, temporal

if TYPE_CHECKING:
    # the package brings numba, which readers of results do without
    from core.body.feet import FootTracks


@dataclass(frozen=True, eq=False)
class TakeFigures:
    """Figures of a take.

    Parameters
    ----------
    columns : parameter of a stride → one entry per stride of the list, counted or not, in its order.
    """

    parameters: tuple[Parameter, ...]
    columns: Mapping[str, Column]


def take_figures(
    strides: Strides,
    angles: JointAngles | None,
    orientations: Oriented | None = None,
    feet: FootTracks | None = None,
    surface: Surface = GROUND,
) -> TakeFigures:
    """Temporal, spatial, angles over the cycle, foot pitch at the contacts.

    Parameters
    ----------
    angles : None = the take was not analysed so far: times only.
    orientations : of the feet, for their pitch; None leaves it out. feet : None = there are no distances.
    """
    columns = per_stride(strides)
    if angles is None:
        return TakeFigures(temporal(strides), columns)
    rows = spatial_rows(strides, feet, surface)
    curves = cycle_curves(angles, strides)
    pitch = None if orientations is None else foot_pitch(orientations, strides)
    figures: dict[str, Mapping[Side, Floats]] = {**stride_figures(curves), **(pitch or {})}
    return TakeFigures(
        parameters=temporal(strides) + spatial(strides, feet, rows, surface) + kinematic(curves, pitch),
        columns=columns | per_stride_spatial(rows) | per_stride_figures(strides, figures),
    )


def gait_parameters(
    strides: Strides,
    angles: JointAngles,
    orientations: Oriented | None = None,
    feet: FootTracks | None = None,
    surface: Surface = GROUND,
) -> tuple[Parameter, ...]:
    """The parameters alone."""
    return take_figures(strides, angles, orientations, feet, surface).parameters
