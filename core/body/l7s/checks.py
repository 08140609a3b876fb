"""Plausibility checks of the L7S sensors: do they move like the feet and pelvis of a walking person?

With two or three sensors no joint has two of them, so a wrong sensor contradicts no other one. It can only be
compared with how people walk: feet alternate, stay below their hips, the outer foot travels further in a
turn, and the pelvis accelerates away from the supporting foot. All values were examined on the simulated
walks of core/simulate and on neura_walk, with correct and with swapped sensors; limits are in health.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from sagittal.core.body.health import longest_run_s
from sagittal.core.body.l7s.filter import L7sInputs, L7sTrack
from sagittal.core.body.l7s.legs import LegModel
from sagittal.core.frames import Bools, Floats, Segment
from sagittal.core.signals.held_samples import cut_blocks
from sagittal.core.signals.rest import find_runs

OUTWARD: Final = (-0.5, 2.0)
"""Left foot left of the right one, in hip widths; healthy walks stay within 0 to 1.3, scissoring aside."""

STRIDE_S: Final = (0.6, 2.5)
"""Time from rest to rest of a foot that is a stride."""

BREAK_S: Final = 0.15
"""Two rests of a foot with less between them are one."""

LEAST_STRIDES: Final = 4

SLOWEST_HZ: Final = 0.2
"""Errors of acceleration make slower changes of height by themselves: 0.05 m/s² here 3 cm."""

RISE_S: Final = 3.0
"""Sitting down or half a squat takes less."""

LEAST_TURN: Final = np.radians(60.0)
"""Root of the sum of the squared turns of the strides below which nothing is said from turns."""


@dataclass(frozen=True, eq=False)
class SeenWalk:
    """Input of the checks: for a block of samples, or a recording.

    Parameters
    ----------
    step : (n, 2) foot still, left and right. forward : (n, 2) horizontal direction of both feet, of any
        length. feet : (n, 2, 2) horizontal positions of the filter, m. pelvis : (n, 3) acceleration upwards
        and to its left, m/s², and forward tilt, rad; None without its sensor.
    """

    step: Bools
    forward: Floats
    feet: Floats
    pelvis: Floats | None

    @classmethod
    def of(cls, inputs: L7sInputs, track: L7sTrack) -> SeenWalk:
        """From a block and the filter's output."""
        forward = inputs.R[:, 1, :2, 2] + inputs.R[:, 2, :2, 2]
        pelvis = _see_pelvis(inputs) if inputs.worn == "3I" else None
        return cls(inputs.step, forward, track.p[:, 1:, :2].copy(), pelvis)

    @classmethod
    def make_room(cls, samples: int, *, pelvis: bool) -> SeenWalk:
        """Allocate for a recording whose blocks are filled in later."""
        return cls(
            np.empty((samples, 2), np.bool_),
            np.empty((samples, 2)),
            np.empty((samples, 2, 2)),
            np.empty((samples, 3)) if pelvis else None,
        )

    def put(self, part: slice, block: SeenWalk) -> None:
        """Store a block at its samples."""
        self.step[part], self.forward[part], self.feet[part] = block.step, block.forward, block.feet
        if self.pelvis is not None:
            self.pelvis[part] = block.pelvis


def walking_checks(walk: SeenWalk, model: LegModel, rate_hz: float) -> dict[str, float]:
    """Quantities by name; those that cannot be determined from the recording are absent.

    Returns
    -------
    `out_of_place_share` : fraction of the time in motion in which the feet are not side by side below the
        hips.
    `phase_off` : distance of the other foot's rest from the middle of a stride, in strides, median. 2I:
    `inner_foot_m`, path of the inner foot minus that of the outer per radian of turn, m: minus the distance
    of the feet, positive if the sides are swapped; `turned_rad`, the total turn it is based on. 3I:
    `toward_foot_mps2`, acceleration of the pelvis toward the foot in single support, negative in walking (an
    inverted pendulum falls away from its foot); `pelvis_tilt_sd_rad` while moving; `pelvis_rise_m`, largest
    change of its height within a few seconds, which L7S assumes constant.
    """
    checks: dict[str, float] = {}
    moving = np.asarray(~walk.step.all(axis=1))
    heading = np.unwrap(np.arctan2(walk.forward[:, 1], walk.forward[:, 0]))
    if moving.any():
        outward = np.empty(len(heading))
        for part in cut_blocks(len(heading)):
            to_left = np.stack((-np.sin(heading[part]), np.cos(heading[part])), axis=1)
            outward[part] = np.sum(to_left * (walk.feet[part, 0] - walk.feet[part, 1]), axis=1)
        outward = outward[moving]
        low, high = (x * model.hip_width for x in OUTWARD)
        checks["out_of_place_share"] = float(np.mean((outward < low) | (outward > high)))
    rests = [_rests(walk.step[:, leg], rate_hz) for leg in range(2)]
    phases = _phases(rests[0], rests[1], rate_hz) + _phases(rests[1], rests[0], rate_hz)
    if len(phases) >= LEAST_STRIDES:
        checks["phase_off"] = float(np.median(np.abs(np.array(phases) - 0.5)))
    if walk.pelvis is not None:
        return checks | _pelvis(walk.pelvis, walk.step, moving, rate_hz)
    return checks | _turns(rests, heading, walk.feet, STRIDE_S[1] * rate_hz)


def longest_gaps(valid: Mapping[Segment, Bools], rate_hz: float) -> dict[Segment, float]:
    """Longest data loss of each sensor in s; `valid` (T,) of each."""
    return {s: longest_run_s(~ok, rate_hz) for s, ok in valid.items()}


def _rests(step: Bools, rate_hz: float) -> np.ndarray:
    """Middle samples of the rests of a foot."""
    joined: list[list[int]] = []
    for start, stop in find_runs(step):
        if joined and start - joined[-1][1] < BREAK_S * rate_hz:
            joined[-1][1] = stop
        else:
            joined.append([start, stop])
    return np.array([(a + b) // 2 for a, b in joined], int)


def _phases(own: np.ndarray, opposite: np.ndarray, rate_hz: float) -> list[float]:
    """Phase of the other foot's rest in each stride of a foot, 0 to 1; 0 without one."""
    phases = []
    for a, b in pairwise(own):
        if STRIDE_S[0] * rate_hz <= b - a <= STRIDE_S[1] * rate_hz:
            inside = opposite[(opposite > a) & (opposite < b)]
            if len(inside) < 2:
                phases.append(float((inside[0] - a) / (b - a)) if len(inside) else 0.0)
    return phases


def _turns(rests: list[np.ndarray], heading: Floats, feet: Floats, longest: float) -> dict[str, float]:
    """Path difference between inner and outer foot: two feet at a distance on a turning body."""
    left, right = rests
    if len(left) < 2 or len(right) < 2:
        return {}
    ways = [_way(rests[leg], heading, feet[:, leg]) for leg in range(2)]
    ahead = np.diff(np.interp(left, right, ways[1])) - np.diff(ways[0])
    # standing and gaps are no strides, of either foot
    pause = np.flatnonzero(np.diff(right) > longest)
    walked = (np.diff(left) <= longest) & (left[:-1] >= right[0]) & (left[1:] <= right[-1])
    for a, b in zip(right[pause], right[pause + 1], strict=True):
        walked &= (left[1:] <= a) | (left[:-1] >= b)
    turn = np.where(walked, np.diff(heading[left]), 0.0)
    square = float(np.sum(turn**2))
    if square < LEAST_TURN**2:
        return {"turned_rad": square**0.5}
    return {"turned_rad": square**0.5, "inner_foot_m": -float(np.sum(ahead * turn)) / square}


def _way(rests: np.ndarray, heading: Floats, p: Floats) -> Floats:
    """Forward distance (rests,) in m travelled by a foot since its first rest."""
    middle = 0.5 * (heading[rests[:-1]] + heading[rests[1:]])
    along = np.stack((np.cos(middle), np.sin(middle)), axis=1)
    return np.concatenate(([0.0], np.cumsum(np.sum(np.diff(p[rests], axis=0) * along, axis=1))))


def _see_pelvis(inputs: L7sInputs) -> Floats:
    """`SeenWalk.pelvis` of a block."""
    R = inputs.R[:, 0]
    to_left = R[:, :2, 1] / np.maximum(np.linalg.norm(R[:, :2, 1], axis=1), 1e-9)[:, None]
    sideways = np.sum(to_left * inputs.acc[:, 0, :2], axis=1)
    return np.stack((inputs.acc[:, 0, 2], sideways, np.arctan2(-R[:, 2, 0], R[:, 2, 2])), axis=1)


def _pelvis(pelvis: Floats, step: Bools, moving: Bools, rate_hz: float) -> dict[str, float]:
    upwards, sideways, tilt = pelvis.T
    checks = {"pelvis_rise_m": _rise(upwards, rate_hz)}
    single_support = [step[:, leg] & ~step[:, 1 - leg] for leg in range(2)]
    if single_support[0].any() and single_support[1].any():
        checks["toward_foot_mps2"] = 0.5 * float(
            sideways[single_support[0]].mean() - sideways[single_support[1]].mean()
        )
    if moving.any():
        checks["pelvis_tilt_sd_rad"] = float(np.std(tilt[moving]))
    return checks


def _rise(vertical: Floats, rate_hz: float) -> float:
    """Largest change of height within `RISE_S`, by double integration of components above `SLOWEST_HZ`."""
    n = len(vertical)
    f = np.fft.rfftfreq(2 * n, 1.0 / rate_hz)[1:]
    gain = -1.0 / (2.0 * np.pi * f) ** 2 * f**4 / (f**4 + SLOWEST_HZ**4)
    spectrum = np.fft.rfft(vertical - vertical.mean(), 2 * n)
    height = np.fft.irfft(spectrum * np.concatenate(([0.0], gain)), 2 * n)[:n]
    window = min(n, round(RISE_S * rate_hz))
    parts = np.lib.stride_tricks.sliding_window_view(height, window)[:: max(1, window // 20)]
    return float(np.ptp(parts, axis=1).max())
