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
    t_s : s on the take's axis. segments : s of them. q : (s, 4) segment to W. p : (s, 3) m, as `Poses`.
    valid : all segments of the figure are measured. contact : side → on the floor; a side that is not known
        is missing. method : of the estimator, as `Poses.method`.
    phase : side → 0 to 1 of the running cycle, None where unknown.
    """

    t_s: float
    segments: tuple[Segment, ...]
    q: Floats
    p: Floats
    valid: bool
    method: str
    contact: Mapping[Side, bool] = field(default_factory=dict)
    phase: Mapping[Side, float | None] = field(default_factory=dict)
