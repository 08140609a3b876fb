"""Real sensors on a walking body with optical segments: two recordings, two laboratories.

Alignment and heading are free, one constant rotation per trial, so these are inclination errors without a
constant offset.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from sagittal.core.frames import FOOT, SIDES, Bools, Floats, Segment
from sagittal.core.fusion.algorithms.benchmark import ReferenceTrial
from sagittal.core.rotation import conjugate, rotate
from tests.data import data_folder
from tests.helpers.gaitmap import MARKERS, MOCAP_RATE, RATE, signals, table
from tests.helpers.walks import neura_walk

UP = np.array([0.0, 0.0, 1.0])
NEURA_ROWS = slice(1119, 2074)
"""Rows of the raw take that the laboratory's segments cover: the walk."""
NEURA_NAMES: dict[Segment, str] = {
    "pelvis": "qRPV", "thigh_r": "qRTH", "thigh_l": "qLTH", "shank_r": "qRSK", "shank_l": "qLSK",
    "foot_r": "qRFT", "foot_l": "qLFT",
}  # fmt: skip
NEURA_REST = slice(300, 1000)
"""Rows of quiet standing."""
STILL_S = 36.6
"""Both feet of gaitmap are still from here on."""
LAGS = range(-4, 5)
"""Samples by which the reference may be late."""


@dataclass(frozen=True, eq=False)
class SegmentTrial:
    """A sensor and the vertical (n, 3) in the axes of its segment, where `trial.moving`."""

    placement: str
    trial: ReferenceTrial
    up: Floats


def inclination_rms(q: Floats, source: SegmentTrial) -> float:
    """RMS angle in rad between the verticals of sensor and segment, after the turn and lag that fit best."""
    return min(
        _fit(rotate(conjugate(q), UP), np.roll(source.up, lag, axis=0), source.trial.moving) for lag in LAGS
    )


def _fit(ours: Floats, theirs: Floats, moving: Bools) -> float:
    part = moving & np.isfinite(theirs).all(axis=1)
    ours, theirs = ours[part], theirs[part]
    u, _, vt = np.linalg.svd(theirs.T @ ours)
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    cosine = np.clip(np.einsum("ni,ij,nj->n", theirs, turn, ours), -1.0, 1.0)
    return float(np.sqrt(np.mean(np.arccos(cosine) ** 2)))


@cache
def neura_segments() -> tuple[SegmentTrial, ...]:
    """Seven segments of one walk of 9.5 s after standing."""
    take = neura_walk()
    path = data_folder("neura_walk") / "vicon" / "S02-Trial-Walk-1.csv"
    lines = [x for x in path.read_text().splitlines() if not x.startswith("//")]
    names = lines[0].split(",")
    table = np.array([[float(x) for x in line.split(",")] for line in lines[1:]])
    part = slice(NEURA_REST.start, NEURA_ROWS.stop)
    rows = np.arange(part.start, part.stop)
    result = []
    for segment, name in NEURA_NAMES.items():
        x = take.sensors[segment]
        index = names.index(f"{name}_1")
        up = np.full((len(rows), 3), np.nan)
        up[rows >= NEURA_ROWS.start] = rotate(conjugate(table[:, index : index + 4]), UP)
        result.append(_trial(segment, take.rate_hz, x.gyr[part], x.acc[part], rows >= NEURA_REST.stop, up))
    return tuple(result)


@cache
def gaitmap_feet() -> tuple[SegmentTrial, ...]:
    """Both feet over 2 × 20 m, run backwards in time: this take is still only at its end.

    A motion run backwards has the opposite rates and the same accelerations.
    """
    x = signals("imu_sample.csv")
    t = np.arange(len(x)) / RATE
    names, mocap = table("mocap_sample.csv")
    result = []
    for i, side in enumerate(SIDES):
        toe, heel, outer = (
            np.stack([_at(t, mocap[:, names.index(f"{side[0].upper()}_{m}/{a}")]) for a in "xyz"], axis=1)
            for m in MARKERS
        )
        acc, gyr = x[::-1, 6 * i : 6 * i + 3], -np.radians(x[::-1, 6 * i + 3 : 6 * i + 6])
        up, moving = _up_in_foot(toe, heel, outer)[::-1], t[::-1] < STILL_S
        result.append(_trial(FOOT[side], RATE, gyr, acc, moving, up))
    return tuple(result)


def _at(t: Floats, values: Floats) -> Floats:
    """Motion capture at times t of the sensors."""
    return np.interp(t, np.arange(len(values)) / MOCAP_RATE, values, right=np.nan)


def _trial(segment: str, rate_hz: float, gyr: Floats, acc: Floats, moving: Bools, up: Floats) -> SegmentTrial:
    none = np.full_like(acc, np.nan)
    reference = np.full((len(acc), 4), np.nan)
    trial = ReferenceTrial(segment, rate_hz, gyr.copy(), acc.copy(), none, reference, moving)
    return SegmentTrial(segment.split("_")[0], trial, up)


def _up_in_foot(toe: Floats, heel: Floats, side: Floats) -> Floats:
    """The vertical (n, 3) in axes of a foot made of three markers (n, 3)."""

    def unit(x: Floats) -> Floats:
        return np.asarray(x / np.linalg.norm(x, axis=1, keepdims=True))

    ahead = unit(toe - heel)
    upper = unit(np.cross(ahead, side - heel))
    lateral = np.cross(upper, ahead)
    return np.stack([ahead[:, 2], lateral[:, 2], upper[:, 2]], axis=1)
