"""What a trunk sensor tells of a walk: steps in time, the foot where it can be told, walking bouts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from core.errors import Notice
from core.events.bouts import Bout
from core.frames import Segment, Side


@dataclass(frozen=True)
class Step:
    """One step: the time of its initial contact in s, and the foot that lands, None if it cannot be told."""

    time_s: float
    side: Side | None


@dataclass(frozen=True, eq=False)
class Steps:
    """The steps of a take in order of time; `source` is the sensor they were read from."""

    steps: tuple[Step, ...]
    bouts: tuple[Bout, ...]
    source: Segment
    notices: tuple[Notice, ...] = ()
    diagnostics: Mapping[str, object] = field(default_factory=dict)

    @property
    def step_times_s(self) -> tuple[float, ...]:
        """Times from contact to contact inside the bouts, those of stops left out."""
        return tuple(
            b.time_s - a.time_s
            for a, b in pairwise(self.steps)
            if any(
                bout.first_s <= a.time_s and b.time_s <= bout.end_s and (a.time_s, b.time_s) not in bout.stops
                for bout in self.bouts
            )
        )

    @property
    def cadence_spm(self) -> float | None:
        """60 / mean step time, steps per minute; None without steps."""
        times = self.step_times_s
        return 60.0 / float(np.mean(times)) if times else None
