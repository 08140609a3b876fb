"""Limits of the common axis, the same for a file and a live take."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TimelineParams:
    """Limits of the common axis.

    Parameters
    ----------
    max_gap_s : longest missing stretch that is interpolated (docs/science/timeline.md, "Parameters").
    min_rate_hz : below, contacts cannot be found (docs/science/timeline.md, "Parameters").
    min_duration_s : shorter takes cannot hold 1 s of rest and two strides [our choice].
    min_share : a sensor that lasts less than this share of the median duration does not cut the take for the
        others; it is invalid where it has no samples [our choice].
    max_stretch : samples of the axis per recorded sample; beyond, the clock must have jumped [our choice].
    on_grid : largest distance from the axis, in samples, at which a sample counts as lying on it.
    """

    max_gap_s: float = 0.1
    min_rate_hz: float = 40.0
    min_duration_s: float = 5.0
    min_share: float = 0.9
    max_stretch: float = 20.0
    on_grid: float = 0.01
