"""Zones of the levels, classification of values, and the sound of an error.

Level 0 is the target ± band. Each higher level extends it by one width, an sd of the target, on the side of
the person; the other, overshooting side is unchanged (Schließmann et al. 2018).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import Final

from sagittal.core.feedback.cue import Tone, Zone
from sagittal.core.feedback.prescription import LEVELS, Prescription, Towards

BASE_HZ: Final = 440.0
SEMITONES_PER_SD: Final = 4.0
LOUDEST_SD: Final = 3.0
QUIETEST: Final = 0.2
"""Pitch and level grow in proportion to the error above the dead band (Nazarahari thesis ch. 8): pitch as an
ear counts it, an octave up at 3 sd, where the level is full too. The figures are our choice."""


@dataclass(frozen=True)
class Zones:
    """Zones of all levels around a target.

    Parameters
    ----------
    mean, sd : of the target, in the unit of the parameter. band : half width of level 0 in sd.
    width : of a level, and of the yellow zone, in sd. worse : the side extended by levels; None = not yet
        known.
    """

    mean: float
    sd: float
    band: float = 1.0
    width: float = 1.0
    worse: Towards | None = None

    def error_sd(self, value: float) -> float:
        """Deviation from the target in its sd, above positive."""
        return (value - self.mean) / self.sd

    def limits(self, level: int) -> tuple[float, float]:
        """Lower and upper end of the zone, in the unit of the parameter."""
        low = self.band + (level * self.width if self.worse == "low" else 0.0)
        high = self.band + (level * self.width if self.worse == "high" else 0.0)
        return self.mean - low * self.sd, self.mean + high * self.sd

    def zone(self, value: float, level: int) -> Zone:
        """Green, yellow with its direction, or red with its direction."""
        low, high = self.limits(level)
        yellow = self.width * self.sd
        if value < low:
            return "low" if value < low - yellow else "near_low"
        if value > high:
            return "high" if value > high + yellow else "near_high"
        return "in"

    def start_level(self, usual: float) -> int:
        """Hardest level whose zone contains the person's usual value."""
        beyond = (abs(self.error_sd(usual)) - self.band) / self.width
        return min(max(ceil(beyond - 1e-9), 0), LEVELS)

    def side_of(self, usual: float) -> Towards:
        """Side of the target on which a value is."""
        return "low" if usual < self.mean else "high"

    def tone(self, value: float, level: int) -> Tone | None:
        """Sound for a value; None inside the zone, which is the dead band."""
        low, high = self.limits(level)
        beyond = max(low - value, value - high) / self.sd
        if beyond <= 0.0:
            return None
        size = min(beyond, LOUDEST_SD)
        pitch = BASE_HZ * 2.0 ** (size * SEMITONES_PER_SD / 12.0)
        return Tone(pitch, min(QUIETEST + (1.0 - QUIETEST) * size / LOUDEST_SD, 1.0))


def make_zones(prescription: Prescription, worse: Towards | None) -> Zones | None:
    """Zones of a prescription; None if its target is not resolved."""
    t = prescription.target
    if t.mean is None or t.sd is None:
        return None
    return Zones(t.mean, t.sd, prescription.band_sd, prescription.progression.sd_per_level, worse)
