"""Identification of the left leg: the trunk accelerates towards the swinging leg.

In single support the ground reaction accelerates the body away from the supporting foot, so the pelvis
accelerates to the side of the swinging leg (Zijlstra & Hof 2003 use this to distinguish left from right
steps) and rotates that side forward. Both are evaluated at the stride frequency, in a walking frame from
strapdown integration since the rest before walking. Phase relative to (rate of left leg − rate of right leg),
observed in two people and five simulated walks: lateral acceleration −31 to 27° (0 expected), turning rate to
the left 111 to 147°. A side is reported only if both agree.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core import rotation
from sagittal.core.frames import Bools, Floats
from sagittal.core.quality.signals import STILL

SMOOTH_S: Final = 0.2
SLOW_S: Final = 2.0
WALKING: Final = 1.5
"""Sum of both legs' rates over a second, rad/s, above which the body walks [our choice]."""
LOOK_BACK_S: Final = 10.0
INTEGRATE_S: Final = 9.0
"""Strapdown velocity and heading stay usable for some seconds after rest."""
STRAIGHT: Final = float(np.radians(25.0))
SHORTEST_S: Final = 3.0
SPEED: Final = (0.2, 3.0)
"""Plausible mean speed of the first steps, m/s; anything else means that the integration failed."""
STRIDE_HZ: Final = (0.4, 1.3)
LATERAL_PHASE: Final = 0.0
TURNING_PHASE: Final = float(np.radians(130.0))
AGREE: Final = float(np.radians(60.0))
STRENGTH: Final = 0.25
"""Share of a signal's amplitude that must lie at the stride frequency (seen: 0.31 to 0.99) [our choice]."""


@dataclass(frozen=True, eq=False)
class _Walk:
    """Pelvis in the walking frame: lateral acceleration (left +), turning rate (left +), straight samples."""

    start: int
    lateral: Floats
    turning: Floats
    straight: Bools


def find_left_leg(acc: Floats, gyr: Floats, first: Floats, second: Floats, rate_hz: float) -> int | None:
    """Number of the left leg: 1, 2, or None if undetermined.

    Parameters
    ----------
    acc, gyr : (n, 3) of the pelvis sensor, m/s², rad/s. first, second : (n,) |ω| on leg 1 and on leg 2.
    """
    walk = _walk(acc, gyr, first + second, rate_hz)
    if walk is None or np.count_nonzero(walk.straight) < SHORTEST_S * rate_hz:
        return None
    part = slice(walk.start, walk.start + len(walk.lateral))
    legs = smooth(first - second, SMOOTH_S, rate_hz)[part]
    t = np.arange(len(legs)) / rate_hz
    grid = np.arange(*STRIDE_HZ, 0.01)
    powers = [abs(_at(legs, walk.straight, t, f)) for f in grid]
    stride = float(grid[int(np.argmax(powers))])
    votes = set()
    for signal, expected in ((walk.lateral, LATERAL_PHASE), (walk.turning, TURNING_PHASE)):
        amplitude = _at(signal, walk.straight, t, stride)
        spread = float(np.std(signal[walk.straight]))
        if spread == 0 or np.sqrt(2) * abs(amplitude) < STRENGTH * spread:
            return None
        phase = float(np.angle(amplitude / _at(legs, walk.straight, t, stride)))
        votes.add(_vote(phase - expected))
    return votes.pop() if len(votes) == 1 else None


def _vote(off: float) -> int | None:
    """1 if a phase is as expected of a left leg, 2 if opposite, None in between."""
    off = abs(rotation.wrap_angle(off))
    return 1 if off < AGREE else 2 if off > np.pi - AGREE else None


def _at(x: Floats, mask: Bools, t: Floats, frequency: float) -> complex:
    """Complex amplitude of x at one frequency over the masked samples."""
    part = x[mask] - x[mask].mean()
    return complex(np.mean(part * np.exp(-2j * np.pi * frequency * t[mask])))


def _walk(acc: Floats, gyr: Floats, legs: Floats, rate_hz: float) -> _Walk | None:
    """Integrate from the last quiet second before the first step."""
    walking = smooth(legs, 1.0, rate_hz) > WALKING
    onset = int(np.argmax(walking))
    still_part = _rest_before(acc, onset, rate_hz)
    if still_part is None:
        return None
    bias = gyr[still_part].mean(axis=0)
    at_rest = acc[still_part].mean(axis=0)
    begin, end = still_part.stop, min(len(acc), onset + round(INTEGRATE_S * rate_hz))
    q = _strapdown(gyr[begin:end] - bias, at_rest, rate_hz)
    world = rotation.rotate(q, acc[begin:end]) - [0.0, 0.0, np.linalg.norm(at_rest)]
    yaw_rate = rotation.rotate(q, gyr[begin:end] - bias)[:, 2]
    slow = smooth(yaw_rate, SLOW_S, rate_hz)
    velocity = np.cumsum(world[:, :2], axis=0) / rate_hz
    first_steps = slice(onset - begin, onset - begin + round(3.0 * rate_hz))
    forward = velocity[first_steps].mean(axis=0)
    speed = float(np.hypot(*forward))
    if not SPEED[0] < speed < SPEED[1]:
        return None
    heading = np.cumsum(slow) / rate_hz
    heading += np.arctan2(forward[1], forward[0]) - heading[first_steps].mean()
    lateral = -np.sin(heading) * world[:, 0] + np.cos(heading) * world[:, 1]
    straight = walking[begin:end] & (np.abs(slow) < STRAIGHT)
    turning = smooth(yaw_rate - slow, SMOOTH_S, rate_hz)
    return _Walk(begin, smooth(lateral, SMOOTH_S, rate_hz), turning, straight)


def _rest_before(acc: Floats, onset: int, rate_hz: float) -> slice | None:
    """The latest of the quietest seconds before a step, None without any.

    Not simply the latest quiet one: the body leans before it steps, and a bias estimated there would rotate
    the world frame.
    """
    width = round(rate_hz)
    starts = list(range(max(0, onset - round(LOOK_BACK_S * rate_hz)), onset - width + 1, max(1, width // 10)))
    if not starts:
        return None
    parts = [acc[s : s + width] for s in starts]
    force = np.array([np.linalg.norm(p.mean(axis=0)) for p in parts])
    unrest = np.array([np.linalg.norm(p.std(axis=0)) for p in parts])
    # where there is no gravity nothing tells which way is up
    unrest = np.divide(unrest, force, out=np.full_like(force, np.inf), where=force > 0.0)
    if unrest.min() > STILL:
        return None
    chosen = starts[int(np.flatnonzero(unrest <= 1.2 * unrest.min())[-1])]
    return slice(chosen, chosen + width)


def _strapdown(rate: Floats, at_rest: Floats, rate_hz: float) -> Floats:
    """Orientation (n, 4), sensor → z up, from the tilt at rest and the bias-free rate."""
    up = at_rest / np.linalg.norm(at_rest)
    axis = np.cross(up, [0.0, 0.0, 1.0])
    sine = float(np.linalg.norm(axis))
    angle = float(np.arctan2(sine, up[2]))
    q = rotation.exp(axis / sine * angle) if sine > 1e-6 else rotation.exp(np.array([angle, 0.0, 0.0]))
    steps = rotation.exp(rate / rate_hz)
    out = np.empty((len(rate), 4))
    for i, step in enumerate(steps):
        out[i] = q
        q = rotation.multiply(q, step)
    return rotation.normalise(out)


def smooth(x: Floats, seconds: float, rate_hz: float) -> Floats:
    """Centred moving mean of x (n,)."""
    width = max(1, round(seconds * rate_hz))
    return np.convolve(x, np.full(width, 1.0 / width), mode="same")
