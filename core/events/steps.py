"""Steps from a trunk sensor: times, sides where determined, and walking bouts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import numpy as np

from sagittal.core.errors import Notice
from sagittal.core.events.bouts import Bout
from sagittal.core.frames import Segment, Side

EDGE_STEPS: Final = 2
"""Steps at each end of a bout that are not steady: one stride (core/events/flags.py, edge_strides)."""


@dataclass(frozen=True)
class Step:
    """One step: the time of its initial contact in s, and the landing side, None if undetermined."""

    time_s: float
    side: Side | None


@dataclass(frozen=True, eq=False)
class Steps:
    """The steps of a recording in chronological order; `source` is the sensor used."""

    steps: tuple[Step, ...]
    bouts: tuple[Bout, ...]
    source: Segment
    notices: tuple[Notice, ...] = ()
    diagnostics: Mapping[str, object] = field(default_factory=dict)

    @property
    def step_times_s(self) -> tuple[float, ...]:
        """Times from contact to contact inside the bouts, without breaks.

        The steps of the first and last stride of a bout, where gait starts and stops, are excluded as in the
        stride list.
        """
        inside = [self._times(bout) for bout in self.bouts]
        return tuple(
            t for times in inside for t in times[EDGE_STEPS : len(times) - EDGE_STEPS] if t is not None
        )

    def _times(self, bout: Bout) -> list[float | None]:
        """Step times of a bout in order, None for a break."""
        contacts = [s.time_s for s in self.steps if bout.first_s <= s.time_s <= bout.end_s]
        return [None if (a, b) in bout.breaks else b - a for a, b in pairwise(contacts)]

    @property
    def cadence_spm(self) -> float | None:
        """60 / mean step time, steps per minute; None without steps."""
        times = self.step_times_s
        return 60.0 / float(np.mean(times)) if times else None
