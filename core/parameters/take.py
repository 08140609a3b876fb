"""All parameters of a recording, and of every stride of its list: each measured once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sagittal.core.angles import JointAngles
from sagittal.core.events.result import Strides
from sagittal.core.frames import Floats, Oriented, Segment, Side
from sagittal.core.parameters.flats import Flats
from sagittal.core.parameters.kinematic import (
    foot_pitch,
    measure_cycles,
    per_stride_figures,
    summarise_angles,
    turning_angle,
    without_bounds,
)
from sagittal.core.parameters.phases import measure_phases
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.rows import Column, figure_columns, side_parameters
from sagittal.core.parameters.smoothness import stride_smoothness
from sagittal.core.parameters.spatial import GROUND, Surface, measure_distances, summarise_distances
from sagittal.core.parameters.stance import find_stances, foot_pitches
from sagittal.core.parameters.symmetry import phase_coordination
from sagittal.core.parameters.temporal import per_stride, summarise_times
from sagittal.core.parameters.trunk import choose_foot, trunk_regularity

if TYPE_CHECKING:
    # the package brings numba, which readers of results do without
    from sagittal.core.body.feet import FootTracks


@dataclass(frozen=True, eq=False)
class TakeFigures:
    """Parameters of a recording.

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
    trunk: Mapping[Segment, Floats] | None = None,
    flats: Flats | None = None,
) -> TakeFigures:
    """Temporal and spatial parameters, parts of stance and swing, angles over the cycle, trunk regularity.

    Parameters
    ----------
    angles : None = not reached by the analysis: times only.
    orientations : of the feet, for their pitch; None omits it. feet : None = no distances.
    trunk : pelvis → (n, 3) acceleration in the walking frame, on the axis of the angles.
    flats : of these strides, if already computed.
    """
    columns = per_stride(strides)
    times = (*summarise_times(strides), phase_coordination(strides))
    if angles is None:
        return TakeFigures(times, columns)
    # before the curves of the angles are held
    of_trunk = (
        *trunk_regularity(choose_foot(strides), angles.t_s, trunk or {}),
        stride_smoothness(choose_foot(strides), angles.t_s, trunk or {}),
    )
    pitch = {} if orientations is None else foot_pitches(orientations)
    flat = find_stances(strides, angles.t_s, pitch)
    distances = measure_distances(strides, feet, surface, flats)
    phases = measure_phases(strides, flat, angles, pitch, feet)
    curves, of_curves = measure_cycles(angles, strides)
    of_feet = turning_angle(strides)
    if orientations is not None:
        of_feet |= foot_pitch(orientations, strides, pitch)
    figures: dict[str, Mapping[Side, Floats]] = {**of_curves, **of_feet}
    return TakeFigures(
        parameters=(
            *times,
            *summarise_distances(strides, feet, distances, surface),
            *side_parameters(strides, flat.parts),
            *side_parameters(strides, phases),
            *summarise_angles(curves, figures),
            *of_trunk,
        ),
        columns={
            **columns,
            **figure_columns({**distances, **flat.parts, **phases}),
            **per_stride_figures(strides, without_bounds(curves, figures)),
        },
    )


def gait_parameters(
    strides: Strides,
    angles: JointAngles,
    orientations: Oriented | None = None,
    feet: FootTracks | None = None,
    surface: Surface = GROUND,
    trunk: Mapping[Segment, Floats] | None = None,
) -> tuple[Parameter, ...]:
    """The parameters alone."""
    return take_figures(strides, angles, orientations, feet, surface, trunk).parameters
