"""Output of the live chain: a frame after every push, a stride at every initial contact.

Everything here is plain values on the axis of core/timeline/live.py: seconds from the first sample of the
recording, SI units and radians, names as in sagittal.core.angles and sagittal.core.parameters. Nothing
imports numba.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from sagittal.core.errors import Notice
from sagittal.core.estimators import NO_FIGURE, LiveMethod
from sagittal.core.events.result import GaitEvent
from sagittal.core.frames import Floats, Segment, Side
from sagittal.core.parameters.live.live_stride import LiveStride

if TYPE_CHECKING:
    from sagittal.core.calibration.score import CalibrationScore

Stage = Literal["waiting", "stand", "walk", "running"]
"""waiting: samples of some sensor are missing; stand, walk: calibration; running: everything there is."""


@dataclass(frozen=True)
class SegmentCheck:
    """Calibration of one sensor.

    Parameters
    ----------
    still : currently at rest. method, score : as in `SegmentCalibration`; None before the walk was evaluated.
    """

    segment: Segment
    still: bool
    method: str | None = None
    score: float | None = None
    notices: tuple[Notice, ...] = ()


@dataclass(frozen=True)
class CalibrationView:
    """Progress of calibration.

    Parameters
    ----------
    stood_s, walked_s, steps : so far, in the current attempt.
    ok : True once it is valid; False after a failed attempt, with the reason in `problem`.
    score : pass or redo, with reasons and remedies, once it is valid; None before.
    """

    stood_s: float
    walked_s: float
    steps: int
    checks: tuple[SegmentCheck, ...]
    ok: bool | None = None
    problem: Notice | None = None
    score: CalibrationScore | None = None


@dataclass(frozen=True)
class SensorHealth:
    """State of one sensor over the last seconds (core/online/health.py).

    Parameters
    ----------
    rate_hz : as measured. lost_share, saturated_share : 0 to 1. silent_s : since its last sample, by the
        clocks of the other streams. still : currently at rest. stuck : sends values that are not measured.
        doubt : code of an active inconsistency with the other sensors (core/agreement/live.py).
    """

    id: str
    segment: Segment | None
    rate_hz: float
    lost_share: float
    saturated_share: float
    silent_s: float
    still: bool
    stuck: bool = False
    doubt: str | None = None


@dataclass(frozen=True, eq=False)
class AngleTrail:
    """Angles since the previous frame: t_s (m,), names (k), values (m, k) in rad, NaN where lost."""

    t_s: Floats
    names: tuple[str, ...]
    values: Floats


EMPTY_TRAIL: Final = AngleTrail(np.zeros(0), (), np.zeros((0, 0)))


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """State after the last sample that a push added to the axis.

    Parameters
    ----------
    t_s : of that sample; 0 before the first. seq : of the batch pushed.
    calibration : None until all sensors stream.
    q : segment → (4,) segment to W. p : segment → (3,) m, as `Poses`. valid : all segments are measured.
        contact : side → on the floor, as far as events are known.
    angles : name → rad, NaN where lost, at the last sample. trail : the same since the previous frame.
        events, strides, notices : new since the previous frame; an event with `first_s` was reported before.
    """

    t_s: float
    seq: int
    stage: Stage
    health: tuple[SensorHealth, ...] = ()
    calibration: CalibrationView | None = None
    method: LiveMethod = NO_FIGURE
    q: Mapping[Segment, Floats] = field(default_factory=dict)
    p: Mapping[Segment, Floats] = field(default_factory=dict)
    valid: bool = False
    contact: Mapping[Side, bool] = field(default_factory=dict)
    angles: Mapping[str, float] = field(default_factory=dict)
    trail: AngleTrail = EMPTY_TRAIL
    events: tuple[GaitEvent, ...] = ()
    strides: tuple[LiveStride, ...] = ()
    notices: tuple[Notice, ...] = ()
