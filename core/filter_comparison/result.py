"""What a comparison of filters gives."""

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
    """Which filters are run.

    Parameters
    ----------
    filters : names of `sagittal.core.fusion.algorithms.choice.LABELS`.
    magnetometer : whether those that can, use one.

    Raises
    ------
    ParameterError of `require_filters`.
    """

    filters: tuple[str, ...]
    magnetometer: bool = True

    def __post_init__(self) -> None:
        require_filters(self.filters)


@dataclass(frozen=True)
class FilterAgreement:
    """One filter in the table, or the product's own chain (`name` None).

    Parameters
    ----------
    cost_us : per sample and sensor; None = not measured. to_median, to_own : RMS over all segments against
        the median of the filters, and against the product's own chain; None where it gave nothing.
    segments : the same against the median, by segment. told : what went wrong, and on which segment.
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
    """How far the filters are apart in one quantity.

    Parameters
    ----------
    name : a joint angle, or `<segment>_inclination`, `<segment>_heading`. filters : how many are behind it.
    sd, range : (m,) rad over the kept samples: standard deviation, and largest less smallest.
    cycle_sd : side → (101,) RMS of `sd` over the counted strides, by percent of the gait cycle.
    stance, swing : side → RMS of `sd` in that phase, None where no foot-off is known.
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
        """RMS of `sd` over the take, rad."""
        return float(np.sqrt(np.nanmean(self.sd**2)))


@dataclass(frozen=True, eq=False)
class BlandAltman:
    """Filter less reference, one quantity of one filter, rad (Bland and Altman 1986).

    Parameters
    ----------
    bias : mean difference. low, high : limits of agreement, bias ∓ 1.96 SD over the samples. n : samples.
    rmse : of the differences. middle, difference : (k,) points of the plot, taken evenly.
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
    """Every filter against an uploaded reference.

    Parameters
    ----------
    lag_s : added to the reference's clock. correlation : of the angular speeds at that lag.
    segments : those that both have. scores : filter (None: own chain) → segment → RMS errors.
    agreement : in the order of filters and quantities. notices : how it was laid onto the take.
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
    """What `compare_filters` gives.

    Parameters
    ----------
    t_s : (m,) kept samples. segments : with a sensor. strides : side → counted ones.
    orientations : filter (None: own chain) → segment → (m, 4) segment to W. valid : segment → (m,).
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
