"""Walking and straight walking: the parts of a recording that show the direction of walking."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians

import numpy as np

from sagittal.core.frames import Bools, Floats, Segment
from sagittal.core.rotation import conjugate, find_lengths, multiply, rotate, wrap_angle
from sagittal.core.signals.filtering import low_pass
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import find_runs

TRUNK: tuple[Segment, ...] = ("pelvis", "chest")
DOWN: tuple[tuple[Segment, ...], ...] = (
    TRUNK,
    ("thigh_l", "thigh_r"),
    ("shank_l", "shank_r"),
    ("foot_l", "foot_r"),
)
"""Sensors that show a turn, the steadiest first."""


@dataclass(frozen=True)
class WalkingParams:
    """Detection of walking and turning.

    Parameters
    ----------
    leg_rate : mean |ω| of the leg sensors over 1 s while walking, rad/s. trunk_std : std |f| of a trunk
        sensor over 1 s, m/s² (both our choice: straight walking on neura_walk has at least 1.9 rad/s and 0.73
        m/s², the simulator's slow walk 1.3 and 2.2, standing at most 0.04 and 0.07).
    shortest_s : shortest straight part used.
    turn_rate, turn_margin_s, turn_cutoff_hz : low-passed yaw rate of a turn
        (docs/science/calibration.md, "Parameters"). Without a trunk sensor the cut-off is halved, because
        legs yaw with every step.
    """

    leg_rate: float = 0.5
    trunk_std: float = 0.35
    shortest_s: float = 1.5
    turn_rate: float = radians(35.0)
    turn_margin_s: float = 0.15
    turn_cutoff_hz: float = 0.8


def moving_mask(recording: UniformRecording, params: WalkingParams) -> Bools:
    """Samples (n,) of walking-like movement: from the leg sensors, or the trunk without them."""
    legs = [s for s in recording.sensors if s not in TRUNK]
    width = max(1, round(recording.rate_hz))
    if legs:
        rate = np.mean([find_lengths(recording.sensors[s].gyr) for s in legs], axis=0)
        return np.asarray(_box(rate, width) > params.leg_rate)
    norm = np.mean([find_lengths(s.acc) for s in recording.sensors.values()], axis=0)
    norm = norm - norm.mean()
    return np.asarray(_box(norm**2, width) - _box(norm, width) ** 2 > params.trunk_std**2)


def turning_mask(
    recording: UniformRecording,
    biases: Mapping[Segment, Floats],
    q: Mapping[Segment, Floats],
    params: WalkingParams,
) -> Bools:
    """Samples (n,) in a turn: |low-passed yaw rate| above the limit, widened by the margin.

    Parameters
    ----------
    q : segment → (n, 4) sensor to its own z-up world.
    """
    turn_segments = turn_sensors(recording)
    rate = np.zeros(len(recording.t_s))
    for s in turn_segments:
        rate += rotate(q[s], recording.sensors[s].gyr - biases[s])[:, 2] / len(turn_segments)
    cutoff = params.turn_cutoff_hz if turn_segments[0] in TRUNK else 0.5 * params.turn_cutoff_hz
    turning = np.abs(low_pass(rate, cutoff, recording.rate_hz)) > params.turn_rate
    reach = round(params.turn_margin_s * recording.rate_hz)
    for a, b in find_runs(turning):
        turning[max(0, a - reach) : b + reach] = True
    return np.asarray(turning)


def turn_sensors(recording: UniformRecording) -> list[Segment]:
    """The steadiest sensors for detecting turns, preferably those without data loss."""
    groups = [[s for s in group if s in recording.sensors] for group in DOWN]
    whole = [[s for s in g if not _gaps(recording, s)] for g in groups]
    return next((g for g in (*whole, *groups) if g), [])


def _gaps(recording: UniformRecording, segment: Segment) -> bool:
    """Whether the sensor was lost for longer than the 0.1 s that are interpolated
    (docs/science/timeline.md, "Rule").
    """
    return any(b - a > 0.1 * recording.rate_hz for a, b in find_runs(~recording.sensors[segment].valid))


def straight_parts(
    moving: Bools, turning: Bools, rate_hz: float, params: WalkingParams
) -> list[tuple[int, int]]:
    """Index ranges [start, stop) of straight walking of at least `shortest_s`; moving, turning (n,)."""
    return [r for r in find_runs(moving & ~turning) if r[1] - r[0] >= params.shortest_s * rate_hz]


def mean_turn(q: Floats, q_rest: Floats, part: tuple[int, int]) -> float:
    """Circular mean of the angle in rad about the vertical from q_rest (4,) to q (n, 4) over an index
    range.
    """
    return float(np.angle(np.exp(1j * measure_turned_angle(q[part[0] : part[1]], q_rest)).mean()))


def measure_turned_angle(q: Floats, q_rest: Floats) -> Floats:
    """Angle (n,) in rad by which q (n, 4) is rotated about the vertical relative to q_rest (4,).

    The twist component of the rotation about z; it is defined for any sensor alignment.
    """
    d = multiply(q, conjugate(q_rest))
    return wrap_angle(np.asarray(2.0 * np.arctan2(d[..., 3], d[..., 0])))


def _box(x: Floats, width: int) -> Floats:
    """Centred moving mean (n,), shorter at the ends."""
    from scipy.ndimage import uniform_filter1d

    return np.asarray(uniform_filter1d(x, min(width, len(x)), mode="nearest"))
