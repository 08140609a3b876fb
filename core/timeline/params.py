"""Limits of the common axis, the same for files and live recordings."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TimelineParams:
    """Limits of the common axis.

    Parameters
    ----------
    max_gap_s : longest interpolated gap (docs/science/timeline.md, "Parameters").
    min_rate_hz : minimum rate for contact detection (docs/science/timeline.md, "Parameters").
    min_duration_s : shorter recordings cannot contain 1 s of rest and two strides [our choice].
    min_share : a sensor shorter than this fraction of the median duration does not shorten the recording for
        the others; it is invalid where it has no samples [our choice].
    max_stretch : largest ratio of axis samples to recorded samples; above it the clock must have jumped [our
        choice].
    on_grid : largest distance from the axis, in samples, at which a sample counts as coincident.
    """

    max_gap_s: float = 0.1
    min_rate_hz: float = 40.0
    min_duration_s: float = 5.0
    min_share: float = 0.9
    max_stretch: float = 20.0
    on_grid: float = 0.01
