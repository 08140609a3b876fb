"""Thresholds of the daily-life monitor and their sources (docs/science/activity.md, "Parameters")."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from sagittal.core.events.bouts import WalkParams
from sagittal.core.events.lumbar import StepTimeParams
from sagittal.core.events.turns import TurnParams

THIGH_SHARE: Final = 0.245
"""Length of the thigh by body height (Winter)."""


@dataclass(frozen=True)
class WearParams:
    """Criteria for sensor non-wear.

    Parameters
    ----------
    still_min : shortest period of non-wear, min. sd, axes : limit of the standard deviation within each
    minute, m/s², and the number of axes below it (van Hees et al. 2013, doi:10.1371/journal.pone.0061691: 13
    mg, two of three
        axes).
    wobble : breathing moves a sensor on the trunk: limit of the standard deviation of 1-s means within a
    minute, m/s², on every axis. Our choice: 2 mg; breathing tilts the chest of simulated sleepers by 0.5 to
    1.5°.
    unmoved : spread of |acc| over 1 s, m/s², below which such a period is extended second by second. Our
    choice.
    gap_s : longer interruptions are reported as gaps; those up to max_gap_s of sagittal.core.timeline are
    filled. Our choice.
    """

    still_min: int = 30
    sd: float = 0.1275
    axes: int = 2
    wobble: float = 0.02
    unmoved: float = 0.15
    gap_s: float = 2.0


@dataclass(frozen=True)
class UprightParams:
    """Estimation of the upright trunk orientation.

    Parameters
    ----------
    walked_s : minimum walking time in a wear period to estimate it. still_s, still : otherwise the first rest
    of this length with |acc| spread below `still` m/s². Our choice except for the 5 s.
    lean_rad, lean_s : leans of at least this amplitude that start and end within this time reveal the forward
    direction. least : their minimum number. agreement : minimum length of their mean direction, 0 to 1. Our
    choice: people lean forward, hardly ever sideways or backward.
    """

    walked_s: float = 4.0
    still_s: float = 5.0
    still: float = 0.3
    lean_rad: float = 0.21
    lean_s: float = 8.0
    least: int = 2
    agreement: float = 0.6


@dataclass(frozen=True)
class TransitionParams:
    """Detection of postural transitions.

    Parameters
    ----------
    lying_rad : inclination exceeded only when lying (thesis 7.2.4). still_s, still : lying includes at least
    this time with |acc| spread below `still` m/s². shortest_lie_s : our choice.
    lean_rad : minimum lean of rising and sitting down (thesis 7.2.5). prominence_rad : of its peak [our
    choice].
    candidate_rad : minimum lean reported as a candidate [our choice]. half_s : a lean extends at most this
    far to either side of its peak. near_lying_s : leans this close to lying are part of it.
    calm_s, calm_inside_s : the rise is measured between the calmest moments within these distances of the
    ends of a lean, outside and inside [our choice].
    rise_share : the chest rises or falls by at least this fraction of the thigh length (thesis 7.2.5).
    thigh_share : thigh length over body height (Winter).
    """

    lying_rad: float = 1.2217
    still_s: float = 1.0
    still: float = 0.5
    shortest_lie_s: float = 3.0
    lean_rad: float = 0.3491
    prominence_rad: float = 0.1745
    candidate_rad: float = 0.1745
    half_s: float = 2.0
    calm_s: float = 1.0
    calm_inside_s: float = 0.3
    near_lying_s: float = 2.0
    rise_share: float = 0.5
    thigh_share: float = THIGH_SHARE


@dataclass(frozen=True)
class StairParams:
    """Stair detection, experimental: generic thresholds unless calibrated (`calibrate_stairs`).

    Parameters
    ----------
    rocks_rad, lean_rad : ascent: the inclination has at least this standard deviation and its mean differs by
    this much from the person's level walking. down_rocks_rad : descent: minimum standard deviation.
    window_s : length of the classification windows; a shorter walk is level. A guess: above the values of
    level walking with turns in three recordings, favouring missed stairs over false detections
    (docs/science/activity.md, "Stairs").
    """

    rocks_rad: float = 0.03
    lean_rad: float = 0.12
    down_rocks_rad: float = 0.055
    window_s: float = 5.0


@dataclass(frozen=True)
class ActivityParams:
    """All parameters of the daily-life monitor.

    Parameters
    ----------
    min_rate_hz : minimum rate for step detection. upright_rad : no steps above this inclination.
    longest_stand_s : longest standing without a step; after that the posture is unknown. Our choice.
    slab_s, margin_s : signals are filtered in slabs with a margin on both sides, and postures are decided day
    by day; results depend on these lengths, but not on how a file is split into blocks.
    """

    min_rate_hz: float = 20.0
    upright_rad: float = 0.7854
    longest_stand_s: float = 1800.0
    slab_s: int = 600
    margin_s: int = 30
    wear: WearParams = field(default_factory=WearParams)
    upright: UprightParams = field(default_factory=UprightParams)
    transitions: TransitionParams = field(default_factory=TransitionParams)
    stairs: StairParams = field(default_factory=StairParams)
    steps: StepTimeParams = field(default_factory=StepTimeParams)
    bouts: WalkParams = field(default_factory=WalkParams)
    turns: TurnParams = field(default_factory=TurnParams)
