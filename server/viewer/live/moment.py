"""One frame of a live avatar."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from sagittal.core.frames import Floats, Segment, Side


@dataclass(frozen=True, eq=False)
class FigureMoment:
    """Poses at one time of a trial.

    Parameters
    ----------
    t_s : s on the trial's time axis. segments : s segments. q : (s, 4) segment to W. p : (s, 3) m, as
        `Poses`.
    valid : all segments are measured. contact : side → foot on the floor; unknown sides are missing. method :
        of the estimator, as `Poses.method`.
    phase : side → 0 to 1 of the current cycle, None if unknown.
    """

    t_s: float
    segments: tuple[Segment, ...]
    q: Floats
    p: Floats
    valid: bool
    method: str
    contact: Mapping[Side, bool] = field(default_factory=dict)
    phase: Mapping[Side, float | None] = field(default_factory=dict)
