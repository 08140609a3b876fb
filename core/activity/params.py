"""Limits of the monitor of daily life and where they are from (docs/science/activity.md, "Parameters")."""

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
    """When a sensor is taken to be off.

    Parameters
    ----------
    still_min : shortest such stretch, min. sd, axes : standard deviation within every minute below this,
        m/s², on so many axes (van Hees et al. 2013, doi:10.1371/journal.pone.0061691: 13 mg, two of three
        axes).
    wobble : a worn trunk breathes: standard deviation of the means over 1 s within a minute below this, m/s²,
        on every axis. Our choice: 2 mg; breathing tilts the chest of the simulated sleepers by 0.5 to 1.5°.
    unmoved : spread of |acc| over 1 s, m/s², with which such a stretch goes on to the second. Our choice.
    gap_s : longer holes are told as gaps, those of up to
        sagittal.core.timeline's max_gap_s are filled. Our choice.
    """

    still_min: int = 30
    sd: float = 0.1275
    axes: int = 2
    wobble: float = 0.02
    unmoved: float = 0.15
    gap_s: float = 2.0


@dataclass(frozen=True)
class UprightParams:
    """How the upright trunk is found.

    Parameters
    ----------
    walked_s : least walking of a wear period that tells it. still_s, still : else the first rest of this
        length with |acc| spread below `still` m/s². Our choice but for the 5 s.
    lean_rad, lean_s : leans of at least this much that come and go within this time show forward. least : of
        them, agreement : length of their mean direction, 0 to 1. Our choice: people bow forward, hardly ever
        sideways or backward.
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
    """Postural transitions.

    Parameters
    ----------
    lying_rad : inclination beyond which nobody is who does not lie (thesis 7.2.4). still_s, still : lying
        holds still at least so long, spread of |acc| below `still` m/s². shortest_lie_s : our choice.
    lean_rad : least lean of rising and sitting down (thesis 7.2.5). prominence_rad : of its peak [our
        choice].
    candidate_rad : least lean that is told as a candidate [our choice]. half_s : a lean reaches at most so
        far to either side of its peak. near_lying_s : leans this close to lying belong to it.
    calm_s, calm_inside_s : the rise is measured between the calmest moments so near to the ends of a lean,
        outside and inside [our choice].
    rise_share : the chest rises or falls by at least this share of the thigh (thesis 7.2.5).
    thigh_share : thigh by body height (Winter).
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
    """Stairs, experimental: one set for everybody until it is calibrated (`calibrate_stairs`).

    Parameters
    ----------
    rocks_rad, lean_rad : stairs go up where the inclination has at least this standard deviation and differs
        in its mean by so much from the own level walking. down_rocks_rad : they go down where it has this
        standard deviation. window_s : walking is judged in windows of this length; a shorter walk is level.
    A guess: above what level walking with turns has in three recordings, so that stairs are rather missed
    than invented (docs/science/activity.md, "Stairs").
    """

    rocks_rad: float = 0.03
    lean_rad: float = 0.12
    down_rocks_rad: float = 0.055
    window_s: float = 5.0


@dataclass(frozen=True)
class ActivityParams:
    """Of everything the monitor does.

    Parameters
    ----------
    min_rate_hz : below, steps cannot be told. upright_rad : no steps beyond this inclination.
    longest_stand_s : standing without a step lasts no longer: beyond, the posture is unknown. Our choice.
    slab_s, margin_s : signals are filtered slab by slab with a margin on both sides, and postures
        decided day by day; results do not depend on how a file is cut, but on these.
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
