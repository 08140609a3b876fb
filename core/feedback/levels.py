"""Current difficulty level, and the rule that changes it (Schließmann et al. 2018;
docs/science/feedback.md).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from statistics import fmean

from sagittal.core.feedback.baseline import Baseline
from sagittal.core.feedback.cue import Zone
from sagittal.core.feedback.prescription import LEVELS, Progression
from sagittal.core.feedback.zones import Zones


class Ladder:
    """Level in one recording, and the strides at that level used by the rule.

    The initial level is the final one of the last training with this prescription, else the level of the
    prescription, else the hardest one whose zone contains the person's usual value: from before this visit,
    or from its first strides.
    """

    def __init__(self, zones: Zones, rule: Progression, baseline: Baseline) -> None:
        self.zones = zones
        self._rule = rule
        self._recent: deque[Zone] = deque(maxlen=rule.window)
        if baseline.mean is not None:
            self._know_side(baseline.mean)
        start = rule.start_level if baseline.last_level is None else baseline.last_level
        if start is None and baseline.mean is not None:
            start = zones.start_level(baseline.mean)
        self.level = start or 0
        self._begun = start is not None

    @property
    def known(self) -> bool:
        """Whether the initial level and the person's side of the target are known."""
        return self._begun and self.zones.worse is not None

    @property
    def window_n(self) -> int:
        """Number of strides at this level, at most the window."""
        return len(self._recent)

    @property
    def limits(self) -> tuple[float, float]:
        """Zone of this level, in the unit of the parameter."""
        return self.zones.limits(self.level)

    def zone(self, value: float) -> Zone:
        """Zone of a value at this level."""
        return self.zones.zone(value, self.level)

    def share(self, zone: Zone) -> float | None:
        """Fraction of the strides at this level in a zone; None without any."""
        return sum(z == zone for z in self._recent) / len(self._recent) if self._recent else None

    def add_stride(self, zone: Zone) -> None:
        """Add a training stride."""
        self._recent.append(zone)

    def end_first_strides(self, values: Sequence[float]) -> None:
        """End of the opening strides of a visit, which provide missing prior data."""
        usual = fmean(values)
        self._know_side(usual)
        if not self._begun:
            self.level, self._begun = self.zones.start_level(usual), True

    def move(self, steps: int) -> None:
        """Manual change: easier (+) or harder (−)."""
        self._begun = True
        self._set(self.level + steps)

    def follow_rule(self) -> None:
        """Make it harder or easier if indicated by the last strides; a new window then begins."""
        if not self._rule.automatic or len(self._recent) < self._rule.window:
            return
        worse = self.zones.worse
        if (self.share("in") or 0.0) > self._rule.share:
            self._set(self.level - 1)
        elif worse is not None and (self.share(worse) or 0.0) > self._rule.away_share:
            # beyond the other side an easier level would change nothing
            self._set(self.level + 1)

    def _know_side(self, usual: float) -> None:
        if self.zones.worse is None:
            self.zones = replace(self.zones, worse=self.zones.side_of(usual))

    def _set(self, level: int) -> None:
        level = min(max(level, 0), LEVELS)
        if level != self.level:
            self.level = level
            self._recent.clear()
