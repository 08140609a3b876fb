"""Contacts of a foot at the moment of contact: detected from its pitch and movement, then refined.

The pitch rule (foot_pitch.py) detects that a foot has left the floor or landed; its extrema are early at
contact and late at foot-off. The pitch rate and the impact around them mark the moment measured by a force
plate: the foot begins to slap down, the push-off ends. A swing that hardly pitches the foot (in a turn, a
first or last step, a shuffle) is detected from its movement between two rests. docs/science/events.md,
"Refinement" and "Swings without pitch". One kernel processes files and streams.
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
    """Parameters of the refinement and of swings without pitch.

    The three data sets are ipol_walks, gaitmap_foot and force_plate_steps; validation/report.md, "Contacts
    against every reference", reports all of them.

    Parameters
    ----------
    contact_share : a contact is half way between the moment the pitch rate last falls through this fraction
        of the slap, its minimum after the highest pitch, and the first impact of this fraction of the hardest
        one until then. Chosen on the three sets together.
    knock_s : interval of the acceleration change that defines an impact. Our choice: one sample at 100 Hz.
    contact_s : search window for the slap after detection of the contact; the refined time is available at
        its end.
    leaving_share : a foot-off is where the pitch rate returns through this fraction of the push-off, its
        minimum in the `leaving_s` before the lowest pitch. Chosen on the three sets together.
    push_s : largest distance of the push-off from the lowest pitch. Our choice.
    least_rad_s : minimum magnitude of a slap or push-off. Our choice: 29°/s.
    lead_s, lag_s : mean offset from the pitch rule's contact and foot-off to the refined ones in the three
        sets; used until the refined time is available, and if there is none.
    still_rad_s, still_s : a foot slower than this for this time is at rest. Our choice.
    swing_rad_s, swing_s, longest_s, step_m : speed, duration and distance that make a movement between two
        rests a swing. Measured on ipol_walks: swings without pitch exceed 1.5 rad/s and 0.3 s and most cover
        at least 11 cm, shifts of a standing foot less.
    least_s : minimum duration of a swing: for shorter ones the lowest pitch was that of the landing, and the
        foot-off is reported again at the beginning of the movement. Our choice: landings of all sets have up
        to 0.08 s, swings from 0.16.
    pause_s : a swing without pitch is reported if the foot's last pitched swing is not longer ago, otherwise
        once the next one follows within this time: mobgap's longest pause inside a walk. A gait without any
        pitched swing is not reported in part.
    hump_rad : minimum rise of the pitch before a slap that counts as landing although the foot does not rest.
        Our choice.
    dip_rad, onset_s : minimum fall of the pitch for a push-off; with less, foot-off is assumed onset_s after
        the start of movement, the median of ipol_walks.
    contact_sd_s, leaving_sd_s : standard uncertainty of a clear event, including definition and person: root
        mean square over the three sets. Most of it is common to all events of a foot. Half the distance
        between the two features of a contact, and half that from foot-off to lowest pitch, are added in
        quadrature.
    flat_sd_s : of a landing without a slap. late_sd_s : of the pitch rule's time with the mean offset.
        loose_sd_s : minimum for a swing without pitch. All measured on ipol_walks.
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
    """Reports of a block, in order: (m,) each.

    kind : 0 = TC, 1 = IC. number : of the event, from 0. known : sample at which it is reported. last : no
    further report on this event; nevertheless a foot-off whose swing proves too short is reported again. at :
    sample of the event, with a fraction. uncertainty_s : standard.
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
    """State carried between two blocks of one foot.

    Parameters
    ----------
    rule : of the pitch. refinement : the parameters in the order of the kernel's.
    pitch : (m,) the last pitches, rad. acc : (m, 3) the last specific forces. counters, sums : indices named
        in foot_contact_kernel.py.
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
        """Initial state at `rate_hz`."""
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
        samples = {
            name: max(1, round(getattr(params, parameter) * rate_hz)) for name, parameter in WINDOWS.items()
        }
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
    """Process a block of samples of one foot, in place.

    Parameters
    ----------
    q : (n, 4) foot to W. valid : (n,) False where the sensor was lost.
    speed : (n,) norm of the angular rate, rad/s, without bias. acc : (n, 3) specific force, foot axes, m/s².
        Without them contacts are detected and refined from pitch alone.
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
    """Import the compiled rule lazily: numba is slow to import and only needed to run it."""
    from sagittal.core.events.foot_contact_kernel import foot_contact_kernel

    return cast("Callable[..., int]", foot_contact_kernel)


def compile_foot_contact_kernel() -> None:
    """Compile the kernel or load it from the cache, so that the first analysis is not delayed."""
    q = np.array([[1.0, 0.0, 0.0, 0.0]])
    advance_foot_contacts(FootContactState.start(100.0), q, np.ones(1, np.bool_))
