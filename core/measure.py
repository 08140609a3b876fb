"""Events, a person's edits → strides → parameters: everything that follows the stride list, in one function.

The pipeline calls it at its end and the server after every edit, so that both give the same numbers. `Tracks`
is what it needs of a finished analysis; nothing here filters a signal, and nothing imports numba.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from core.angles import JointAngles
from core.body.feet import FootTracks
from core.edits import Edit, edited_events, edited_strides
from core.errors import Notice
from core.events.flags import StrideParams
from core.events.result import GaitEvents, Strides
from core.events.strides import stride_list
from core.frames import Bools, Floats, Segment
from core.parameters import Surface, take_figures
from core.parameters.result import Parameter
from core.parameters.rows import Column


@dataclass(frozen=True, eq=False)
class Tracks:
    """What strides and parameters are measured on, all on one uniform axis.

    Parameters
    ----------
    t_s : (n,) s from recording start.
    events : as detected, before any edit.
    q, valid : foot → (n, 4) foot to world, scalar first, and (n,) the sensor was there: heading and pitch.
    turning : (n,) mask of the calibration, None if not known.
    feet : paths of the feet, None where no distance can be measured. angles : None when not reached.
    trunk : pelvis, chest → (n, 3) acceleration free of gravity, forward, left, up (m/s²): core/walking_frame.
    params : of the stride list.
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

    @property
    def duration_s(self) -> float:
        """Time of the last sample."""
        return float(self.t_s[-1]) if len(self.t_s) else 0.0


@dataclass(frozen=True, eq=False)
class Measured:
    """What the events and edits give.

    Parameters
    ----------
    columns : parameters of every stride of the list, counted or not, in its order.
    """

    events: GaitEvents
    strides: Strides
    parameters: tuple[Parameter, ...]
    columns: Mapping[str, Column]

    @property
    def notices(self) -> tuple[Notice, ...]:
        """Of the stride list."""
        return self.strides.notices


def measure(tracks: Tracks, edits: Sequence[Edit] = ()) -> Measured:
    """Apply the edits and measure again.

    Raises
    ------
    ParameterError
        An edit does not fit the events: `no_such_event`, `event_outside`, `event_order` (core/edits.py).
    """
    events = edited_events(tracks.events, edits, tracks.duration_s)
    strides = edited_strides(stride_list(events, tracks, tracks.turning, tracks.params), edits)
    figures = take_figures(strides, tracks.angles, tracks, tracks.feet, tracks.surface, tracks.trunk)
    return Measured(events, strides, figures.parameters, figures.columns)
