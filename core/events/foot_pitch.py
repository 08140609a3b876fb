"""Initial and terminal contact from the pitch of the foot: a real-time rule with two extrema per stride.

Signal: s = upward component of the foot's forward axis, 0 at standing, toes up positive; independent of
heading and of Euler angles. The foot leaves the floor at a minimum of s below −0.2 and lands at the following
maximum. Source: Nazarahari thesis ch. 6, Algorithm 1, with the departures of docs/science/events.md,
"Departures from the thesis" (times in seconds, both the time of the extremum and the time of detection).

The interval between the maximum and the true contact depends on the landing pattern: with a foot that pitches
up until it touches the floor it is within a few ms, otherwise early by up to 0.1 s (docs/science/events.md,
section on the extrema). An initial contact before the first terminal contact is not reported, by design.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sagittal.core.frames import Bools, Floats


@dataclass(frozen=True)
class FootPitchParams:
    """Parameters of the rule.

    Parameters
    ----------
    window_s : time before an extremum over which it must be extreme; also the minimum time between two events
        of one kind (thesis Alg 1: 15 samples at 100 Hz).
    monotone_share : fraction of the sample-to-sample changes in the window that must lead towards the
        extremum (thesis Alg 1: 0.8).
    threshold : level of s between stance and push-off (thesis Alg 1: −0.2 = 11.5° toes down). Do not raise
        it: at −0.1 most contacts of a drop foot are missed (docs/science/events.md, "Refusals").
    fall : an initial contact with the toes up is accepted once s has fallen by this amount below its maximum,
        or by half of it; if s rises again before, it was a plateau of the swing, and the later maximum is
        used. Our choice: the additive noise on s that the rule tolerates (tests/core/events). A foot landing
        on its heel falls that far within a few samples: real recordings give the same contacts with and
        without this rule.
    min_rate_hz : at lower rates the window has fewer than six samples.
    suspect_max : a foot that never pitches up above this was not level at rest, unless it is in mid-stance:
        6°, our choice.
    suspect_quiet : largest mean |s| of quiet standing, and of mid-stance: 6°, our choice.
    quiet_rad_s : mean angular speed below which a second counts as quiet standing, our choice.
    """

    window_s: float = 0.150
    monotone_share: float = 0.8
    threshold: float = -0.2
    fall: float = 0.01
    min_rate_hz: float = 40.0
    suspect_max: float = 0.1
    suspect_quiet: float = 0.1
    quiet_rad_s: float = float(np.radians(3.0))


@dataclass(eq=False)
class FootPitchState:
    """State of the rule carried between two blocks of one foot.

    Parameters
    ----------
    ring : (window + 3,) the last values of s. counters : (6,) samples processed, consecutive valid samples, 0
        = stance or 1 = swing, sample of the last detection of TC and of IC, sample of the pending maximum or
        −1.
    held : (3,) the pending maximum, the value before it, its sub-sample offset (2 = not yet known).
    """

    ring: Floats
    counters: NDArray[np.int64]
    held: Floats
    window: int
    need: int
    threshold: float
    fall: float

    @classmethod
    def start(cls, rate_hz: float, params: FootPitchParams) -> FootPitchState:
        """Initial state at `rate_hz`."""
        window = round(params.window_s * rate_hz)
        never = -(1 << 40)
        return cls(
            ring=np.zeros(window + 3),
            counters=np.array([0, 0, 0, never, never, -1], np.int64),
            held=np.zeros(3),
            window=window,
            need=int(np.ceil(params.monotone_share * window - 1e-9)),
            threshold=params.threshold,
            fall=params.fall,
        )


def advance_foot_pitch(
    state: FootPitchState, s: Floats, valid: Bools
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], Floats]:
    """Process a block of samples of one foot, in place.

    Parameters
    ----------
    s : (n,) foot pitch signal. valid : (n,) False where the sensor was lost.

    Returns
    -------
    (m,) kind 0 = TC, 1 = IC; (m,) sample of the extremum since the start; (m,) sample of detection; (m,)
    sub-sample offset from a parabola through three samples, within ±0.5.
    """
    room = 2 * (len(s) // (state.window + 1) + 1)
    kind, index, detections = (np.empty(room, np.int64) for _ in range(3))
    offset = np.empty(room)
    # numba is slow to import and only needed here
    from sagittal.core.events.foot_pitch_kernel import foot_pitch_kernel

    # copies: the kernel is compiled once, for writable contiguous arrays of these types
    m = foot_pitch_kernel(
        np.array(s, np.float64), np.array(valid, np.bool_), state.ring, state.counters, state.held,
        state.window, state.need, state.threshold, state.fall, kind, index, detections, offset,
    )  # fmt: skip
    return kind[:m], index[:m], detections[:m], offset[:m]


def pitch_signal(q_foot: Floats) -> Floats:
    """Pitch signal s (n,) of foot orientations (n, 4): sine of the foot's pitch, toes up positive (thesis
    Eq 52).
    """
    w, x, y, z = q_foot[:, 0], q_foot[:, 1], q_foot[:, 2], q_foot[:, 3]
    return np.asarray(2.0 * (x * z - w * y))


def compile_foot_pitch_kernel() -> None:
    """Compile the kernel or load it from the cache, so that the first analysis is not delayed."""
    advance_foot_pitch(FootPitchState.start(100.0, FootPitchParams()), np.zeros(1), np.ones(1, np.bool_))
