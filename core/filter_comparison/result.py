"""Result of a comparison of filters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sagittal.core.errors import Notice
from sagittal.core.frames import Bools, Floats, Segment, Side
from sagittal.core.fusion.algorithms.benchmark import OrientationScore
from sagittal.core.fusion.algorithms.choice import require_filters


@dataclass(frozen=True)
class FilterRequest:
    """Filters to run.

    Parameters
    ----------
    filters : names of `sagittal.core.fusion.algorithms.choice.LABELS`.
    magnetometer : use it in filters that support one.

    Raises
    ------
    ParameterError as `require_filters`.
    """

    filters: tuple[str, ...]
    magnetometer: bool = True

    def __post_init__(self) -> None:
        require_filters(self.filters)


@dataclass(frozen=True)
class FilterAgreement:
    """One filter in the table, or the final orientations of the analysis (`name` None).

    Parameters
    ----------
    cost_us : per sample and sensor; None = not measured. to_median, to_own : RMS over all segments relative
        to the median of the filters, and to the analysis; None without a result.
    segments : the same relative to the median, by segment. told : notices on failures, by segment.
    """

    name: str | None
    label: str
    cost_us: float | None
    to_median: OrientationScore | None
    to_own: OrientationScore | None
    segments: Mapping[Segment, OrientationScore]
    told: tuple[Notice, ...] = ()


@dataclass(frozen=True, eq=False)
class FilterSpread:
    """Spread of the filters in one quantity.

    Parameters
    ----------
    name : a joint angle, or `<segment>_inclination`, `<segment>_heading`. filters : their number. sd, range :
        (m,) rad over the compared samples: standard deviation, and maximum minus minimum.
    cycle_sd : side → (101,) RMS of `sd` over the counted strides, by percent of the gait cycle.
    stance, swing : side → RMS of `sd` in that phase, None without known foot-offs.
    """

    name: str
    filters: int
    sd: Floats
    range: Floats
    cycle_sd: Mapping[Side, Floats]
    stance: Mapping[Side, float | None]
    swing: Mapping[Side, float | None]

    @property
    def rms(self) -> float:
        """RMS of `sd` over the recording, rad."""
        return float(np.sqrt(np.nanmean(self.sd**2)))


@dataclass(frozen=True, eq=False)
class BlandAltman:
    """Filter minus reference, one quantity of one filter, rad (Bland and Altman 1986).

    Parameters
    ----------
    bias : mean difference. low, high : limits of agreement, bias ∓ 1.96 SD over the samples. n : samples.
    rmse : of the differences. middle, difference : (k,) evenly sampled points of the plot.
    """

    filter: str | None
    quantity: str
    n: int
    bias: float
    low: float
    high: float
    rmse: float
    middle: Floats
    difference: Floats


@dataclass(frozen=True, eq=False)
class ReferenceScores:
    """Every filter compared with an uploaded reference.

    Parameters
    ----------
    lag_s : added to the reference's clock. correlation : of the angular speeds at that lag.
    segments : the common ones. scores : filter (None: analysis) → segment → RMS errors. agreement : in the
        order of filters and quantities. notices : on the alignment with the recording.
    """

    source: str
    lag_s: float
    correlation: float
    segments: tuple[Segment, ...]
    scores: Mapping[str | None, Mapping[Segment, OrientationScore]]
    agreement: tuple[BlandAltman, ...]
    notices: tuple[Notice, ...]


@dataclass(frozen=True, eq=False)
class FilterComparison:
    """Result of `compare_filters`.

    Parameters
    ----------
    t_s : (m,) compared samples. segments : with a sensor. strides : side → counted ones.
    orientations : filter (None: analysis) → segment → (m, 4) segment to W. valid : segment → (m,).
    """

    request: FilterRequest
    t_s: Floats
    segments: tuple[Segment, ...]
    strides: Mapping[Side, int]
    filters: tuple[FilterAgreement, ...]
    spreads: tuple[FilterSpread, ...]
    reference: ReferenceScores | None
    notices: tuple[Notice, ...]
    orientations: Mapping[str | None, Mapping[Segment, Floats]]
    valid: Mapping[Segment, Bools]
