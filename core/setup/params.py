"""Limits of what is said about a set-up."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SetupParams:
    """When a set-up is said to be wrong (docs/science/setup.md).

    Parameters
    ----------
    refuse : False analyses a take all the same whose set-up is wrong; what is found is told.
    sample_s : how long walking is averaged against the rest beside it; begins_s : so long after or before it.
        Three averages of each rest.
    least_rate : averages in which a sensor turns less say nothing, rad/s RMS.
    least_windows : fewer say nothing of a sensor.
    misfit_mps2, misfit_ratio : of an accelerometer and its gyroscope, from which they are said to differ, and
        over that of the best other axes. Right sensors have at most 0.7 m/s² and 1.2 (neura_walk,
        qmt_fullbody, gaitmap_foot, simulated people), wrong signs 4 to 8 m/s² and 6 or more on real takes.
    distinct : other axes that fit so much worse than the best are ruled out.
    """

    refuse: bool = True
    sample_s: float = 3.0
    begins_s: tuple[float, ...] = (0.5, 2.0, 3.5)
    least_rate: float = 0.25
    least_windows: int = 3
    misfit_mps2: float = 0.3
    misfit_ratio: float = 3.0
    distinct: float = 1.5
