"""Contacts of a foot at the moment of contact: found by its pitch and by its movement, then refined.

The pitch rule (foot_pitch.py) tells that a foot has left or landed; its extrema are early at contact and late
at foot-off. The pitch rate and the knock around them have the moment that a force plate means: the sole
begins to slap down, the push-off is over. A swing that hardly pitches the foot (in a turn, a first or last
step, a shuffle) is found by its movement between two rests. docs/science/events.md, "Refinement" and "Swings
without pitch". One kernel runs over a file and over a stream.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cache
from typing import Final, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from sagittal.core.events.foot_pitch import FootPitchParams, FootPitchState
from sagittal.core.frames import Bools, Floats


@dataclass(frozen=True)
class FootContactParams:
    """Parameters of refinement and of swings without pitch.

    The three sets are ipol_walks, gaitmap_foot and force_plate_steps; validation/report.md, "Contacts against
    every reference", has every one of them.

    Parameters
    ----------
    contact_share : a contact is half way between the moment the pitch rate last falls through this share of
        the slap, its deepest value after the highest pitch, and the first knock of this share of the hardest
        until then. Chosen on the three sets together.
    knock_s : over so long a change of the acceleration is a knock. Our choice: a sample at 100 Hz.
    contact_s : the slap is looked for in so long after the contact is known; the refined time follows then.
    leaving_share : a foot-off is where the pitch rate comes back through this share of the push-off, its
        deepest value in the `leaving_s` before the lowest pitch. Chosen on the three sets together.
    push_s : further from the lowest pitch the push-off belongs to something else. Our choice.
    least_rad_s : a shallower slap or push-off is none. Our choice: 29°/s.
    lead_s, lag_s : mean distance from the pitch rule's contact and foot-off to the refined ones on the three
        sets; stands in until the refined time is known, and where there is none.
    still_rad_s, still_s : a foot slower than this for so long is at rest. Our choice.
    swing_rad_s, swing_s, longest_s, step_m : a movement between two rests that is so fast, so long and leads
        so far is a swing. Measured on ipol_walks: swings without pitch exceed 1.5 rad/s and 0.3 s and most
        lead 11 cm and more, shifts of a standing foot lead less far.
    least_s : a shorter swing is none: the lowest pitch was that of the landing, and the foot-off is told
        again where the movement begins. Our choice: landings of all sets have up to 0.08 s, swings from 0.16.
    pause_s : a swing without pitch is told where the foot's last pitched swing is no longer ago, else once
        the next follows within this: mobgap's longest pause inside a walk. A gait without any pitched swing
        is not told by halves.
    hump_rad : a rise of the pitch that ends in a slap is a landing though the foot does not rest. Our choice.
    dip_rad, onset_s : a pitch that falls by less shows no push-off; the foot then leaves so long after it
        begins to move, the median of ipol_walks.
    contact_sd_s, leaving_sd_s : standard uncertainty of a clear event, definition and person included: root
        mean square over the three sets. Most of it is the same for all events of a foot. Half the distance of
        the two features of a contact, and half that from foot-off to lowest pitch, are added as squares.
    flat_sd_s : of a landing without a slap. late_sd_s : of the pitch rule's time with the mean distance.
    loose_sd_s : the least of a swing without pitch. All measured on ipol_walks.
    """

    contact_share: float = 0.4
    knock_s: float = 0.01
    contact_s: float = 0.15
    leaving_share: float = 0.65
    leaving_s: float = 0.3
    push_s: float = 0.12
    least_rad_s: float = 0.5
    lead_s: float = 0.03
    lag_s: float = 0.025
    still_rad_s: float = 0.5
    still_s: float = 0.1
    swing_rad_s: float = 1.5
    swing_s: float = 0.25
    least_s: float = 0.12
    longest_s: float = 2.0
    step_m: float = 0.1
    hump_rad: float = 0.07
    dip_rad: float = 0.02
    onset_s: float = 0.13
    pause_s: float = 3.0
    contact_sd_s: float = 0.018
    leaving_sd_s: float = 0.012
    flat_sd_s: float = 0.05
    late_sd_s: float = 0.04
    loose_sd_s: float = 0.05


_NOTHING: Final = np.zeros((1, 3))


class ContactReports(NamedTuple):
    """What a block made known, in order: (m,) each.

    kind : 0 = TC, 1 = IC. number : of the event, from 0. known : sample at which it is told. last : nothing
    more is to come about this event; a foot-off whose swing proves too short is told again all the same.
    at : sample of the event, with a fraction. uncertainty_s : standard.
    """

    kind: NDArray[np.int64]
    number: NDArray[np.int64]
    known: NDArray[np.int64]
    last: Bools
    at: Floats
    uncertainty_s: Floats


WINDOWS: Final = {
    "leaving": "leaving_s", "after": "contact_s", "quiet": "still_s", "apart": "knock_s", "swing": "swing_s",
    "longest": "longest_s", "onset": "onset_s", "pause": "pause_s", "least": "least_s",
}  # fmt: skip
"""Name in the kernel → parameter that it takes in samples, at least one."""


@dataclass(eq=False)
class FootContactState:
    """What is remembered between two blocks of one foot.

    Parameters
    ----------
    rule : of the pitch. refinement : the parameters in the order of the kernel's.
    pitch : (m,) the last pitches, rad. acc : (m, 3) the last specific forces.
    counters, sums : places named in foot_contact_kernel.py.
    """

    rule: FootPitchState
    refinement: Floats
    pitch: Floats
    acc: Floats
    counters: NDArray[np.int64]
    sums: Floats

    @classmethod
    def start(
        cls, rate_hz: float, pitch: FootPitchParams | None = None, params: FootContactParams | None = None
    ) -> FootContactState:
        """State before the first sample at `rate_hz`."""
        # numba is slow to import and only needed here
        from sagittal.core.events.contact_moments_kernel import ContactRule
        from sagittal.core.events.foot_contact_kernel import (
            BOTTOM,
            COUNTERS,
            HELD,
            NONE,
            OPEN_TOP,
            PITCHED,
            SUMS,
        )

        params = params or FootContactParams()
        samples = {name: max(1, round(getattr(params, of) * rate_hz)) for name, of in WINDOWS.items()}
        same = {"rate_hz": rate_hz, **asdict(params), **samples}
        rule = [same[name] for name in ContactRule._fields]
        size = 2 + sum(samples[name] for name in ("longest", "leaving", "quiet", "apart"))
        counters = np.zeros(COUNTERS, np.int64)
        counters[OPEN_TOP] = -1
        counters[[BOTTOM, PITCHED, HELD]] = NONE
        return cls(
            rule=FootPitchState.start(rate_hz, pitch or FootPitchParams()),
            refinement=np.array(rule, np.float64),
            pitch=np.zeros(size),
            acc=np.zeros((size, 3)),
            counters=counters,
            sums=np.zeros(SUMS),
        )


def advance_foot_contacts(
    state: FootContactState, q: Floats, valid: Bools, speed: Floats | None = None, acc: Floats | None = None
) -> ContactReports:
    """Advance one foot by a block of samples, in place.

    Parameters
    ----------
    q : (n, 4) foot to W. valid : (n,) False where the sensor was lost.
    speed : (n,) norm of the angular rate, rad/s, without bias. acc : (n, 3) specific force, foot axes, m/s².
        Without them contacts are found and refined by pitch alone.
    """
    room = 4 * (len(q) // (state.rule.window + 1) + 3)
    found_int, found_float = np.empty((room, 4), np.int64), np.empty((room, 2))
    moves = speed is not None and acc is not None
    rule = state.rule
    # copies: the kernel is compiled once, for writable contiguous arrays of these types
    m = _load_kernel()(
        np.array(q, np.float64),
        np.array(speed, np.float64) if moves else _NOTHING[0],
        np.array(acc, np.float64) if moves else _NOTHING,
        np.array(valid, np.bool_), moves,
        rule.ring, rule.counters, rule.held, rule.window, rule.need, rule.threshold, rule.fall,
        state.pitch, state.acc, state.counters, state.sums, state.refinement, found_int, found_float,
    )  # fmt: skip
    if m == 0:
        return _NO_REPORTS
    whole, parts = found_int[:m], found_float[:m]
    return ContactReports(whole[:, 0], whole[:, 1], whole[:, 2], whole[:, 3] == 1, parts[:, 0], parts[:, 1])


_NONE: Final = np.empty(0, np.int64)
_NO_REPORTS: Final = ContactReports(_NONE, _NONE, _NONE, np.empty(0, np.bool_), np.empty(0), np.empty(0))


@cache
def _load_kernel() -> Callable[..., int]:
    """The compiled rule: numba is slow to import and only needed to run it."""
    from sagittal.core.events.foot_contact_kernel import foot_contact_kernel

    return cast("Callable[..., int]", foot_contact_kernel)


def compile_foot_contact_kernel() -> None:
    """Compile (or load from the cache) the kernel, so that the first analysis does not wait for it."""
    q = np.array([[1.0, 0.0, 0.0, 0.0]])
    advance_foot_contacts(FootContactState.start(100.0), q, np.ones(1, np.bool_))
