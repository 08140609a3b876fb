"""Swings of a foot by its displacement: for feet with little pitch, little rotation or short rests.

A foot that is dragged along the floor, or carried flat, shows no push-off and no foot slap, and may rotate no
faster in swing than another foot in stance. It is still displaced. A movement between two rests is a swing if
it covers enough distance; foot-off and contact are where the speed along that distance rises and falls.
docs/science/events.md, "Swings by their way". Files and streams use the same kernel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cache
from typing import Final, cast

import numpy as np
from numpy.typing import NDArray

from sagittal.core.events.foot_contact import ContactReports
from sagittal.core.frames import Bools, Floats


@dataclass(frozen=True)
class FootWayParams:
    """Parameters of swings by displacement; values without a cited source were chosen by the authors.

    Chosen on nine simulated impaired walks at 100 Hz, `last_share` also at 50 and 60 Hz; ipol_walks served as
    a check. Other seeds, sizes and rates are in validation/accuracy/test_events_impaired.py.

    Parameters
    ----------
    chord_s : duration over which the angular rate is averaged.
    floor_rad_s, ceiling_rad_s : limits of the person's rest level, the split (Otsu) of the logarithm of the
        angular rates; a foot rests below it. moved_rad_s, lately_s : rates are counted only if the foot
        exceeded `moved_rad_s` within the last `lately_s`, so that long standing does not shift the split.
    hold_s, calm_mps2 : a foot rests after `hold_s` below the level with an acceleration below `calm_mps2`. A
        foot carried evenly rotates no more than a resting one, but decelerates before it lands.
    tilt_mps2 : largest residual of gravity at rest due to attitude errors, about 3°; it is subtracted.
    long_s : a movement without displacement is merged with the next unless the foot rests this long: a heel
        rises and is held before the foot swings.
    shortest_s, longest_s : of a movement.
    least_m, share : smallest displacement of a swing, absolute and as a share of the person's typical one.
    edge_off, edge_on : shares of the peak speed along the path that define foot-off and contact.
    leaving_share, push_s, leaving_s, dip_rad : foot-off by a push-off as in `FootContactParams`, of one
        that turns the foot by `least_rad_s` or more and ends within `near_push_s` of the other.
    landing_s, last_share, contact_share, near_s, knock_s, least_knock : contact by impacts: among those
        between half the speed and `landing_s` after `edge_on`, the last with `last_share` of the largest,
        from its first `contact_share` within `near_s` on. An impact is the change of force over `knock_s`;
        those below `least_knock`, m/s², are ignored.
    sd_s : standard uncertainty of a contact, half of that of a foot-off without a push. leaving_sd_s : of
        a push-off, as in `FootContactParams`.
    learn_s : interval at which a stream updates the rest level, seconds of walking.
    """

    chord_s: float = 0.1
    floor_rad_s: float = float(np.radians(6.0))
    ceiling_rad_s: float = float(np.radians(30.0))
    moved_rad_s: float = float(np.radians(20.0))
    hold_s: float = 0.05
    long_s: float = 0.3
    calm_mps2: float = 1.0
    contact_share: float = 0.4
    last_share: float = 0.35
    tilt_mps2: float = 0.5
    shortest_s: float = 0.15
    longest_s: float = 3.5
    least_m: float = 0.05
    share: float = 0.15
    edge_off: float = 0.08
    edge_on: float = 0.1
    leaving_share: float = 0.65
    least_rad_s: float = 2.0
    push_s: float = 0.12
    leaving_s: float = 0.3
    dip_rad: float = 0.02
    knock_s: float = 0.01
    least_knock: float = 3.0
    near_s: float = 0.04
    near_push_s: float = 0.2
    sd_s: float = 0.05
    leaving_sd_s: float = 0.012
    learn_s: float = 1.0
    landing_s: float = 0.2
    lately_s: float = 2.0


WINDOWS: Final = {
    "leaving": "leaving_s", "chord": "chord_s", "hold": "hold_s", "long": "long_s", "shortest": "shortest_s",
    "longest": "longest_s", "near": "near_s", "apart": "knock_s", "learn": "learn_s",
    "landing": "landing_s", "lately": "lately_s",
    "near_push": "near_push_s",
}  # fmt: skip
"""Name in the kernel → parameter that it takes in samples, at least one."""


@dataclass(eq=False)
class FootWayState:
    """State of one foot between two blocks.

    Parameters
    ----------
    rule : the parameters in the order of the kernel's. turns (m, 4), track (m, 3), acc (m, 3),
        course (m, 2) : orientations, derived quantities, forces and velocities of the last seconds.
    counters, sums : indices named in way_kernel.py. counts : histogram of the angular rates so far.
    shortest : samples of the shortest movement. learns : whether the rest level is still being learned.
    """

    rule: Floats
    turns: Floats
    track: Floats
    acc: Floats
    course: Floats
    counters: NDArray[np.int64]
    sums: Floats
    counts: Floats
    shortest: int
    learns: bool = True

    @classmethod
    def start(cls, rate_hz: float, params: FootWayParams | None = None) -> FootWayState:
        """State before the first sample at `rate_hz`."""
        # numba is slow to import and only needed here
        from sagittal.core.events.way_kernel import (
            BINS,
            COUNTERS,
            LAST,
            LEVEL,
            MOVING,
            NEVER,
            SUMS,
            TRACK,
            UNKNOWN,
            WayRule,
        )

        params = params or FootWayParams()
        samples = {
            name: max(1, int(np.ceil(getattr(params, parameter) * rate_hz - 1e-9)))
            for name, parameter in WINDOWS.items()
        }
        # a push-off that is not clear is told by the speed
        same = {"rate_hz": rate_hz, "late_sd_s": params.sd_s, **asdict(params), **samples}
        size = 2 + samples["longest"] + 4 * samples["chord"] + samples["long"]
        counters = np.zeros(COUNTERS, np.int64)
        counters[LAST], counters[MOVING] = NEVER, UNKNOWN
        sums = np.zeros(SUMS)
        sums[LEVEL] = (params.floor_rad_s * params.ceiling_rad_s) ** 0.5
        return cls(
            rule=np.array([same[name] for name in WayRule._fields], np.float64),
            turns=np.zeros((size, 4)),
            track=np.zeros((size, TRACK)),
            acc=np.zeros((size, 3)),
            course=np.zeros((size, 2)),
            counters=counters,
            sums=sums,
            counts=np.zeros(BINS),
            shortest=samples["shortest"],
        )

    def learn(self, q: Floats, valid: Bools) -> None:
        """Learn the own level of rest from a part of a take q (n, 4), valid (n,), too, and keep it."""
        from sagittal.core.events.way_kernel import learn_level

        q, valid = np.array(q, np.float64), np.array(valid, np.bool_)
        learn_level(q, valid, self.counts, self.sums, self.rule)
        self.learns = False

    @property
    def level_rad_s(self) -> float:
        """The own level of rest, rad/s."""
        return float(self.sums[0])


def advance_foot_ways(state: FootWayState, q: Floats, valid: Bools, acc: Floats) -> ContactReports:
    """Advance one foot by a block of samples, in place.

    Parameters
    ----------
    q : (n, 4) foot to W. valid : (n,) False where the sensor was lost. acc : (n, 3) specific force, foot
        axes, m/s².
    """
    room = 2 * (len(q) // state.shortest + 3)
    found_int, found_float = np.empty((room, 4), np.int64), np.empty((room, 2))
    # copies: the kernel is compiled once, for writable contiguous arrays of these types
    m = _load_kernel()(
        np.array(q, np.float64), np.array(acc, np.float64), np.array(valid, np.bool_),
        state.turns, state.track, state.acc, state.course, state.counters, state.sums, state.counts,
        state.rule, state.learns, found_int, found_float,
    )  # fmt: skip
    whole, parts = found_int[:m], found_float[:m]
    return ContactReports(whole[:, 0], whole[:, 1], whole[:, 2], whole[:, 3] == 1, parts[:, 0], parts[:, 1])


@cache
def _load_kernel() -> Callable[..., int]:
    """The compiled rule: numba is slow to import and only needed to run it."""
    from sagittal.core.events.way_kernel import foot_way_kernel

    return cast("Callable[..., int]", foot_way_kernel)


def compile_foot_way_kernel() -> None:
    """Compile (or load from the cache) the kernels, so that the first analysis does not wait for them."""
    q, valid = np.array([[1.0, 0.0, 0.0, 0.0]]), np.ones(1, np.bool_)
    state = FootWayState.start(100.0)
    advance_foot_ways(state, q, valid, np.zeros((1, 3)))
    state.learn(q, valid)
