"""Events and manual edits → strides → parameters: everything after the stride list, in one function.

Called at the end of the pipeline and by the server after every edit, so that both give the same numbers.
`Tracks` is the required part of a finished analysis; nothing here filters a signal, and nothing imports
numba.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sagittal.core.angles import JointAngles
from sagittal.core.body.feet import FootTracks
from sagittal.core.consistency.doubt import Doubt
from sagittal.core.consistency.feet import judge_feet
from sagittal.core.errors import Notice
from sagittal.core.events.alternation import AlternationParams, measure_foot_lag
from sagittal.core.events.bouts import Bout, BoutParams, find_bouts
from sagittal.core.events.edits import Edit, apply_event_edits, apply_stride_edits
from sagittal.core.events.flags import StrideParams, add_flag
from sagittal.core.events.result import GaitEvents, Strides
from sagittal.core.events.steps import Steps
from sagittal.core.events.strides import count_strides, stride_list
from sagittal.core.events.turns import Turn
from sagittal.core.frames import FOOT, Bools, Floats, Segment, Side
from sagittal.core.parameters import Surface, take_figures
from sagittal.core.parameters.between_feet import withhold_doubtful
from sagittal.core.parameters.flats import Flats, find_flats
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.rows import Column
from sagittal.core.parameters.smoothness import stride_smoothness
from sagittal.core.parameters.spatial import in_place
from sagittal.core.parameters.trunk import trunk_regularity
from sagittal.core.parameters.uncertainty import state_uncertainty
from sagittal.core.parameters.walking import bout_parameters, step_parameters, step_strides, turn_parameters
from sagittal.core.signals.rest import Window


@dataclass(frozen=True, eq=False)
class Tracks:
    """Data for measuring strides and parameters, all on one uniform axis.

    Parameters
    ----------
    t_s : (n,) s from recording start.
    events : as detected, before any edit.
    q, valid : foot → (n, 4) foot to world, scalar first, and (n,) sensor available, for heading and pitch.
    turning : (n,) mask of the calibration, None if unknown.
    feet : paths of the feet, None if no distance can be measured. angles : None if not reached.
    trunk : pelvis, chest → (n, 3) gravity-free acceleration, forward, left, up (m/s²): core/walking_frame.
    params : of the stride list. bout_params : of the walking bouts of the feet's contacts.
    rests : windows of quiet standing, None if unknown. standing : those of the feet alone, including short
        ones (core/signals/rest.py, STANDING). turns : of the body. steps : of a trunk sensor, if no foot has
        one; they are not editable.
    doubts : contradictions in the signals (core/consistency); edits do not change them.
    """

    t_s: Floats
    rate_hz: float
    events: GaitEvents
    q: Mapping[Segment, Floats]
    valid: Mapping[Segment, Bools]
    turning: Bools | None = None
    feet: FootTracks | None = None
    angles: JointAngles | None = None
    trunk: Mapping[Segment, Floats] = field(default_factory=dict)
    surface: Surface = field(default_factory=Surface)
    params: StrideParams = field(default_factory=StrideParams)
    bout_params: BoutParams = field(default_factory=BoutParams)
    rests: tuple[Window, ...] | None = None
    standing: tuple[Window, ...] = ()
    turns: tuple[Turn, ...] = ()
    steps: Steps | None = None
    doubts: tuple[Doubt, ...] = ()

    @property
    def duration_s(self) -> float:
        """Time of the last sample."""
        return float(self.t_s[-1]) if len(self.t_s) else 0.0


@dataclass(frozen=True, eq=False)
class MeasuredGait:
    """Result of measuring the events with edits.

    Parameters
    ----------
    columns : parameters of every stride of the list, counted or not, in its order.
    bouts : walking bouts. turns : of the body. steps : of a trunk sensor without foot sensors.
    """

    events: GaitEvents
    strides: Strides
    parameters: tuple[Parameter, ...]
    columns: Mapping[str, Column]
    bouts: tuple[Bout, ...] = ()
    turns: tuple[Turn, ...] = ()
    steps: Steps | None = None

    @property
    def notices(self) -> tuple[Notice, ...]:
        """Notices of the stride list and the steps."""
        return self.strides.notices + (() if self.steps is None else self.steps.notices)


def _regular(tracks: Tracks, steps: Steps) -> tuple[Parameter, ...]:
    strides = step_strides(steps)
    return (
        *trunk_regularity(strides, tracks.t_s, tracks.trunk),
        stride_smoothness(strides, tracks.t_s, tracks.trunk),
    )


def measure_gait(tracks: Tracks, edits: Sequence[Edit] = ()) -> MeasuredGait:
    """Apply the edits and measure again.

    Raises
    ------
    ParameterError An edit does not match the events: `no_such_event`, `event_outside`, `event_order` of
        core/events/edits.py.
    """
    events = apply_event_edits(tracks.events, edits, tracks.duration_s)
    detected_strides = stride_list(events, tracks, tracks.turning, tracks.params)
    flats = None if tracks.feet is None else find_flats(detected_strides, tracks.feet)
    strides = apply_stride_edits(_walked(tracks, detected_strides, flats), edits)
    figures = take_figures(strides, tracks.angles, tracks, tracks.feet, tracks.surface, tracks.trunk, flats)
    # contacts, found or set by a person, say more than the trunk
    steps = None if events.events else tracks.steps
    if steps is None:
        bouts = find_bouts(events, tracks.rests, tracks.bout_params, tracks.standing)
    else:
        bouts = steps.bouts
    first = figures.parameters if steps is None else _of_steps(tracks, steps, figures.parameters)
    estimated = () if tracks.angles is None else tracks.angles.estimated
    first = state_uncertainty(first, events, estimated, feet_lag_s=_find_feet_lag(tracks, events))
    doubts = tracks.doubts + judge_feet(
        events, strides, bouts, lambda s, times_s: _is_measured(tracks, s, times_s)
    )
    if doubts:
        strides = replace(strides, notices=(*strides.notices, *(x.notice for x in doubts)))
    parameters = withhold_doubtful(first + bout_parameters(bouts) + turn_parameters(tracks.turns), doubts)
    return MeasuredGait(events, strides, parameters, figures.columns, bouts, tracks.turns, steps)


def _is_measured(tracks: Tracks, side: Side, at_s: Floats) -> Bools:
    """Whether the sensor of a foot was available at times (n,) s; assumed true without any known foot."""
    valid = tracks.valid.get(FOOT[side])
    if valid is None:
        return np.ones(len(at_s), np.bool_)
    start = float(tracks.t_s[0]) if len(tracks.t_s) else 0.0
    index = np.clip(np.round((at_s - start) * tracks.rate_hz).astype(np.int64), 0, len(valid) - 1)
    return np.asarray(valid[index], np.bool_)


def _find_feet_lag(tracks: Tracks, events: GaitEvents) -> float:
    """Estimated clock offset of one foot, s; 0 if a chain of sensors links the feet, or if undetermined."""
    if tracks.feet is not None and tracks.feet.linked:
        return 0.0
    return abs(measure_foot_lag(events, AlternationParams()) or 0.0)


def _walked(tracks: Tracks, detected_strides: Strides, flats: Flats | None) -> Strides:
    """The stride list, without strides in place if the paths of the feet are known."""
    marching = in_place(detected_strides, tracks.feet, tracks.surface, flats).tolist()
    if not marching:
        return detected_strides
    listed = list(detected_strides.strides)
    for i in marching:
        listed[i] = add_flag(listed[i], "in_place")
    return count_strides(listed, tracks.params)


def _of_steps(tracks: Tracks, steps: Steps, figures: tuple[Parameter, ...]) -> tuple[Parameter, ...]:
    """Parameters from the trunk; in addition missing ones of foot sensors that gave no contacts, with
    their reasons.
    """
    trunk_parameters = (*step_parameters(steps), *_regular(tracks, steps))
    keys = {(p.name, p.side) for p in trunk_parameters}
    return trunk_parameters + tuple(p for p in figures if tracks.q and (p.name, p.side) not in keys)
