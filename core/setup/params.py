"""Thresholds of the set-up checks."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SetupParams:
    """Thresholds of the set-up checks (docs/science/setup.md).

    Parameters
    ----------
    refuse : False analyses a recording despite an incorrect set-up, with a notice.
    sample_s : averaging time of walking next to a rest; begins_s : its distances from the rest. Three
    averages per rest.
    least_rate : averages with a lower rate of turn are ignored, rad/s RMS.
    least_windows : minimum number to judge a sensor.
    misfit_mps2, misfit_ratio : misfit between accelerometer and gyroscope that counts as a contradiction,
    absolute and relative to that of the best alternative axes. Correct sensors have at most 0.7 m/s² and 1.2
    (neura_walk,
        qmt_fullbody, gaitmap_foot, simulated people), wrong signs 4 to 8 m/s² and 6 or more on real
        recordings.
    distinct : alternatives that fit worse than the best by this factor are ruled out.
    """

    refuse: bool = True
    sample_s: float = 3.0
    begins_s: tuple[float, ...] = (0.5, 2.0, 3.5)
    least_rate: float = 0.25
    least_windows: int = 3
    misfit_mps2: float = 0.3
    misfit_ratio: float = 3.0
    distinct: float = 1.5
