"""The three-body walker of Potter et al. 2021 (data set 1): a pelvis and two straight legs with hinged hips.

It serves to reproduce Tables 2 and 3 of that paper; people do not walk like this (docs/science/simulation.md,
"Potter's walker"). Sensors are 8 cm above the midpoint of the hips and at the ends of the legs, aligned with
their segments.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.frames import GRAVITY, SIDES, Bools, Floats, Side
from sagittal.core.rotation import about, conjugate, multiply, rotate
from sagittal.core.simulate.gait.stance import Q_NEUTRAL
from sagittal.core.simulate.shapes import bump, smoothstep
from sagittal.core.simulate.spline import differentiate_pose
from sagittal.core.simulate.walker import SIGN

LEG_M: Final = 0.92
HIP_WIDTH_M: Final = 0.39
PELVIS_SENSOR_M: Final = 0.08
"""Height of the pelvis sensor above the line of the hips."""

STRIDE_M: Final = 0.73
STRIDE_S: Final = 0.73 / 0.33
STILL_S: Final = 0.1
"""At the start of each step nothing moves for so long; the paper's footfalls."""

LEAD_S: Final = 3.0
"""Still at the start."""

OVERSHOOT: Final = 0.25
"""The swinging leg goes beyond its landing angle by about this share of it."""

IMUS: Final = ("pelvis", "leg_r", "leg_l")
LEG: Final[Mapping[Side, int]] = {"right": 1, "left": 2}
"""Index of a leg's sensor in `IMUS`."""

ACC_SD: Final = 0.027
"""White noise of the accelerometer per sample at 512 Hz, m/s² (Potter Table 1)."""

GYR_SD: Final = float(np.radians(5.66))
"""White noise of the gyroscope per sample at 512 Hz, rad/s (Potter Table 1;
docs/science/erkf.md, "Departures from the paper")."""


@dataclass(frozen=True)
class HipJoint:
    """One hip: sensors `proximal` and `distal` by index, its centre in the axes of both sensors, m (3,)."""

    proximal: int
    distal: int
    in_proximal_m: Floats
    in_distal_m: Floats


@dataclass(frozen=True, eq=False)
class PotterWalk:
    """Exact ground truth and ideal signals of three sensors; the sensor axis of the arrays is that of `IMUS`.

    Parameters
    ----------
    t_s : (n,). acc, gyr : (n, 3, 3) m/s², rad/s. p, v : (n, 3, 3) m, m/s in the world. q : (n, 3, 4).
    hips : side → joint. hinge_axis : (3,) axis of both hips, the same in the axes of all three sensors.
    still : (n,) both feet and the pelvis are at rest.
    hip_flexion : side → (n,) rad. Hip adduction and rotation are exactly zero.
    footfalls : side → sample at which the foot comes to rest, one per step of that foot. footfall_still :
        samples from a footfall to the middle of the following still period.
    """

    t_s: Floats
    rate_hz: float
    acc: Floats
    gyr: Floats
    p: Floats
    v: Floats
    q: Floats
    hips: Mapping[Side, HipJoint]
    hinge_axis: Floats
    still: Bools
    hip_flexion: Mapping[Side, Floats]
    footfalls: Mapping[Side, tuple[int, ...]]
    footfall_still: int

    def add_noise(
        self, acc_sd: float = ACC_SD, gyr_sd: float = GYR_SD, seed: int = 0
    ) -> tuple[Floats, Floats]:
        """Signals (n, 3, 3) with white noise of this standard deviation per sample, the only error in the
        paper.
        """
        rng = np.random.default_rng(seed)
        return (
            self.acc + rng.normal(0.0, acc_sd, self.acc.shape),
            self.gyr + rng.normal(0.0, gyr_sd, self.gyr.shape),
        )

    def strides(self, p: Floats | None = None) -> tuple[Floats, Floats]:
        """Stride lengths and widths (strides,) in m of a track p (n, 3, 3), of the truth if none is given.

        Both are evaluated in the middle of the still periods; width is the other foot's distance from the
        line between two footprints of one foot, so neither changes under rotation of the whole track.
        """
        track = self.p if p is None else p
        lengths, widths = [], []
        for side in SIDES:
            opposite: Side = "left" if side == "right" else "right"
            own_positions = track[np.array(self.footfalls[side]) + self.footfall_still, LEG[side], :2]
            opposite_samples = np.array(self.footfalls[opposite]) + self.footfall_still
            for a, b, first, last in zip(
                own_positions[:-1],
                own_positions[1:],
                self.footfalls[side][:-1],
                self.footfalls[side][1:],
                strict=True,
            ):
                along = b - a
                length = float(np.hypot(*along))
                inside = opposite_samples[
                    (opposite_samples > first + self.footfall_still) & (opposite_samples < last)
                ]
                off = track[inside[0], LEG[opposite], :2] - a
                lengths.append(length)
                widths.append(abs(along[0] * off[1] - along[1] * off[0]) / length)
        return np.array(lengths), np.array(widths)


def potter_walk(strides: int = 200, rate_hz: float = 512.0) -> PotterWalk:
    """Walk straight along +x, right foot in front at the start; 200 strides take 446 s.

    The swinging foot passes slightly below the floor, as in the paper.
    """
    step_s = 0.5 * STRIDE_S
    n = round((LEAD_S + strides * STRIDE_S + 1.0) * rate_hz)
    t = np.arange(n) / rate_hz
    step = np.clip(np.floor((t - LEAD_S) / step_s).astype(int), -1, 2 * strides - 1)
    into = np.where(step < 0, 0.0, t - LEAD_S - step * step_s)
    u = (into - STILL_S) / (step_s - STILL_S)
    reach = np.arcsin(STRIDE_M / (4.0 * LEG_M))
    stance = reach - 2.0 * reach * smoothstep(u)
    swing = -stance + OVERSHOOT * reach * bump(u)
    right_stands = (np.maximum(step, 0) % 2) == 0
    angle: dict[Side, Floats] = {
        "right": np.where(right_stands, stance, swing),
        "left": np.where(right_stands, swing, stance),
    }
    loaded = np.where(right_stands, angle["right"], angle["left"])
    foot_x = 0.5 * STRIDE_M * np.maximum(step, 0)
    middle = np.stack((foot_x - LEG_M * np.sin(loaded), np.zeros(n), LEG_M * np.cos(loaded)), axis=-1)

    poses = {"pelvis": (middle + np.array([0.0, 0.0, PELVIS_SENSOR_M]), np.tile(Q_NEUTRAL, (n, 1)))}
    hips: dict[Side, HipJoint] = {}
    for s in SIDES:
        out = SIGN[s] * 0.5 * HIP_WIDTH_M
        q = multiply(Q_NEUTRAL, about(2, angle[s]))
        hip = middle + np.array([0.0, -out, 0.0])
        poses[IMUS[LEG[s]]] = (hip + rotate(q, np.array([0.0, -LEG_M, 0.0])), q)
        hips[s] = HipJoint(0, LEG[s], np.array([0.0, -PELVIS_SENSOR_M, out]), np.array([0.0, LEG_M, 0.0]))
    signals = [_signals(t, *poses[name]) for name in IMUS]
    acc, gyr, v = (np.stack([s[k] for s in signals], axis=1) for k in range(3))
    starts = [round((LEAD_S + k * step_s) * rate_hz) for k in range(2 * strides + 1)]
    return PotterWalk(
        t_s=t,
        rate_hz=rate_hz,
        acc=acc,
        gyr=gyr,
        p=np.stack([poses[name][0] for name in IMUS], axis=1),
        v=v,
        q=np.stack([poses[name][1] for name in IMUS], axis=1),
        hips=hips,
        hinge_axis=np.array([0.0, 0.0, 1.0]),
        still=(into < STILL_S) | (t < LEAD_S) | (t > LEAD_S + strides * STRIDE_S),
        hip_flexion=angle,
        footfalls={"right": tuple(starts[2::2]), "left": tuple(starts[1::2])},
        footfall_still=round(0.5 * STILL_S * rate_hz),
    )


def _signals(t: Floats, p: Floats, q: Floats) -> tuple[Floats, Floats, Floats]:
    """Specific force, angular rate and velocity (n, 3) of one sensor."""
    velocity, acceleration, rate = differentiate_pose(t, p, q)
    return rotate(conjugate(q), acceleration + np.array([0.0, 0.0, GRAVITY])), rate, velocity
