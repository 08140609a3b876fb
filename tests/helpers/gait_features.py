"""Clinical gait features from ground truth: medians over the steady strides of one side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sagittal.core.frames import FOOT, SUFFIX, Floats, Side
from sagittal.core.rotation import rotate
from sagittal.core.simulate.truth import TrueStride, WalkTruth
from sagittal.core.simulate.walker import SIGN


@dataclass(frozen=True)
class Features:
    """One side; degrees, per cent of the cycle, m, mm.

    Parameters
    ----------
    knee_swing, knee_stance_min : peak flexion in swing, least in stance. pitch_contact, pitch_min : of the
        foot, toes up. swing_dorsiflexion : largest in mid-swing. obliquity : largest rise of this side in the
        last three quarters of swing. lateral_mm : of the foot off its line, outwards.
    """

    stance: float
    knee_swing: float
    knee_stance_min: float
    pitch_contact: float
    pitch_min: float
    hip_max: float
    hip_range: float
    swing_dorsiflexion: float
    obliquity: float
    lateral_mm: float
    step_m: float
    stride_cv: float
    cadence: float


def features(truth: WalkTruth, side: Side) -> Features:
    """Features of one side of a simulated walk."""
    t, end, mirror = truth.t_s, SUFFIX[side], SIGN[side]
    strides = [s for s in truth.strides if s.side == side][1:-2]
    knee, hip, ankle = (
        np.degrees(truth.angles[f"{name}_{end}"])
        for name in ("knee_flexion", "hip_flexion", "ankle_dorsiflexion")
    )
    rise = mirror * np.degrees(truth.angles["pelvis_obliquity"])
    foot = truth.p[FOOT[side]][:, :2]
    pitch = np.degrees(np.arcsin(rotate(truth.q[FOOT[side]], np.array([1.0, 0.0, 0.0]))[:, 2]))

    def median(source: Callable[[TrueStride], float]) -> float:
        return float(np.median([source(s) for s in strides]))

    def within(start: float, stop: float) -> slice:
        return slice(*np.searchsorted(t, (start, stop)).tolist())

    def swing(s: TrueStride, first: float = 0.0, last: float = 1.0) -> slice:
        length = s.end_s - s.release_s
        return within(s.release_s + first * length, s.release_s + last * length)

    def outward(s: TrueStride) -> float:
        way = foot[swing(s)]
        along = (way[-1] - way[0]) / np.linalg.norm(way[-1] - way[0])
        aside: Floats = (way - way[0]) @ np.array([along[1], -along[0]])
        return 1e3 * float((mirror * aside).max())

    times = np.array([s.end_s - s.start_s for s in strides])
    steps = [f.step_m for f in truth.footprints[side][2:-1] if not f.closes and not f.opens]
    return Features(
        stance=median(lambda s: 100.0 * (s.release_s - s.start_s) / (s.end_s - s.start_s)),
        knee_swing=median(lambda s: knee[swing(s)].max()),
        knee_stance_min=median(lambda s: knee[within(s.start_s, s.release_s)].min()),
        pitch_contact=median(lambda s: float(np.interp(s.end_s, t, pitch))),
        pitch_min=median(lambda s: pitch[within(s.start_s, s.end_s)].min()),
        hip_max=median(lambda s: hip[within(s.start_s, s.end_s)].max()),
        hip_range=median(lambda s: float(np.ptp(hip[within(s.start_s, s.end_s)]))),
        swing_dorsiflexion=median(lambda s: ankle[swing(s, 0.35, 0.9)].max()),
        obliquity=median(lambda s: rise[swing(s, 0.25)].max()),
        lateral_mm=median(outward),
        step_m=float(np.median(steps)),
        stride_cv=float(100.0 * times.std() / times.mean()),
        cadence=float(120.0 / np.median(times)),
    )
