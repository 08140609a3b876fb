"""All parameters of one stride on a window of samples, by the definitions for whole recordings
(core/parameters).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, isnan
from typing import Final

import numpy as np

from sagittal.core.angles import JointAngles
from sagittal.core.body.feet import FootTracks
from sagittal.core.events.result import Stride, Strides
from sagittal.core.frames import Bools, Floats, Segment
from sagittal.core.parameters.catalogue import list_curve_figures
from sagittal.core.parameters.flats import find_flats
from sagittal.core.parameters.kinematic import (
    FOOT_PITCH,
    MEAN_ZERO,
    cycle_curves,
    foot_pitch,
    stride_figures,
    turning_angle,
)
from sagittal.core.parameters.live.live_stride import NOT_YET
from sagittal.core.parameters.phases import measure_phases
from sagittal.core.parameters.plausible import IMPOSSIBLE, is_impossible
from sagittal.core.parameters.rows import Value, read_row
from sagittal.core.parameters.spatial import NAMES as SPATIAL
from sagittal.core.parameters.spatial import Surface, measure_distances
from sagittal.core.parameters.stance import find_stances, foot_pitches
from sagittal.core.parameters.temporal import explain_missing, temporal_values


@dataclass(frozen=True, eq=False)
class StrideSpan:
    """Part of a recording that contains a stride, `Oriented` of pelvis and feet.

    Parameters
    ----------
    t_s : (n,). q, valid : segment → (n, 4), (n,). angles, feet : on the same axis.
    """

    t_s: Floats
    q: Mapping[Segment, Floats]
    valid: Mapping[Segment, Bools]
    angles: JointAngles | None
    feet: FootTracks | None


NO_ANGLES: Final = JointAngles(np.zeros(2), {}, {})

Figures = tuple[dict[str, Value], dict[str, Floats]]
"""Value or reason by name; curve (101,) rad by variable."""


def early_figures(stride: Stride, span: StrideSpan, surface: Surface) -> Figures:
    """Parameters available at the contact that ends the stride; of distances only those given by a belt."""
    one = Strides((stride,))
    figures: dict[str, Value] = {}
    for name, column in temporal_values(one).items():
        value = float(column[0])
        figures[name] = explain_missing(name, (stride,)) if isnan(value) else value
        if is_impossible(name, value):
            figures[name] = IMPOSSIBLE
    pitch = foot_pitches(span)
    flat = find_stances(one, span.t_s, pitch)
    curves = cycle_curves(span.angles or NO_ANGLES, one)
    figures |= read_row({**flat.parts, **measure_phases(one, flat, span.angles, pitch, span.feet)}, 0)
    read_from = list_curve_figures()
    angle_reasons = dict.fromkeys(read_from, "joint_missing") | dict.fromkeys(FOOT_PITCH, "no_foot_sensor")
    figures |= angle_reasons | {"turning_angle_deg": "gap"}
    read = {**stride_figures(curves, read_from), **turning_angle(one), **foot_pitch(span, one, pitch)}
    for name, sides in read.items():
        values = sides.get(stride.side)
        if values is not None and len(values):
            value = float(values[0])
            reason = "no_terminal_contact" if name == FOOT_PITCH[1] and stride.tc_s is None else "gap"
            if name in read_from and (
                suppression := curves.why.get(read_from[name].variable, {}).get(stride.side)
            ):
                reason = suppression
            figures[name] = value if isfinite(value) else reason
    if surface.protocol == "treadmill" or span.feet is None or stride.side not in span.feet.p:
        figures |= read_row(measure_distances(one, span.feet, surface), 0)
    else:
        figures |= dict.fromkeys(SPATIAL, NOT_YET)
    # courses first, as in a take with both feet
    order = sorted(curves.curves.items(), key=lambda x: x[0] not in MEAN_ZERO)
    rows = {name: by_side[stride.side][0] for name, by_side in order if stride.side in by_side}
    return figures, {name: row for name, row in rows.items() if bool(np.isfinite(row).all())}


def late_figures(
    stride: Stride, context: Sequence[Stride], span: StrideSpan, surface: Surface
) -> dict[str, Value]:
    """Distances between foot-flats, available once both feet have left the floor again.

    Parameters
    ----------
    context : the neighbouring strides, in chronological order.
    """
    flats = None
    if span.feet is not None:
        flats = find_flats(Strides((*context, stride)), span.feet).select(slice(-1, None))
    return read_row(measure_distances(Strides((stride,)), span.feet, surface, flats), 0)
