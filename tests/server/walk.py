"""A small kinematic walk with known joint curves: level, straight, the lower foot on the floor."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from sagittal.core import rotation
from sagittal.core.angles import JointAngles
from sagittal.core.body.feet import FootTracks
from sagittal.core.body.model import BodyModel
from sagittal.core.body.poses import Poses
from sagittal.core.events.result import EventKind, GaitEvent, GaitEvents, Stride, Strides
from sagittal.core.frames import FOOT, R_NEUTRAL, SHANK, SIDES, SUFFIX, THIGH, Bools, Floats, Segment, Side
from sagittal.core.parameters.measure import Tracks

BODY = BodyModel(hip_width=0.2, thigh=0.43, shank=0.43, ankle_height=0.07, foot=0.26, estimated=True)
PHASE: Mapping[Side, float] = {"left": 0.0, "right": 0.5}
STRIDE_S = 1.1
FOOT_OFF = 0.62


def _curve(percent: list[float], degrees: list[float]) -> CubicSpline:
    return CubicSpline(np.array(percent) / 100, np.radians(degrees), bc_type="periodic")


HIP = _curve([0, 10, 30, 50, 60, 75, 85, 100], [30, 27, 8, -10, -6, 22, 33, 30])
KNEE = _curve([0, 13, 28, 40, 50, 62, 73, 85, 95, 100], [4, 17, 9, 5, 10, 38, 60, 34, 3, 4])
ANKLE = _curve([0, 7, 25, 45, 55, 63, 72, 85, 100], [0, -6, 5, 11, 2, -18, -6, 1, 0])


def flexion(t_s: Floats, side: Side) -> tuple[Floats, Floats, Floats]:
    """Hip, knee and ankle flexion in rad."""
    phase = (t_s / STRIDE_S + PHASE[side]) % 1.0
    return HIP(phase), KNEE(phase), ANKLE(phase)


def poses(duration_s: float = 12.0, rate_hz: float = 100.0, lost: tuple[float, float] | None = None) -> Poses:
    """Segment poses of the walk; no chest; `lost` is a time range without signal."""
    t = np.arange(round(duration_s * rate_hz)) / rate_hz
    neutral = rotation.from_matrix(R_NEUTRAL)
    sway = 2 * np.pi * t / STRIDE_S
    turn = rotation.about(2, np.radians(5) * np.cos(sway))
    q: dict[Segment, Floats] = {"pelvis": rotation.multiply(turn, neutral)}
    p: dict[Segment, Floats] = {"pelvis": np.stack((1.2 * t, 0.02 * np.sin(sway), 0 * t), axis=1)}
    lowest = np.full(len(t), np.inf)
    for side in SIDES:
        hip, knee, ankle = flexion(t, side)
        q[THIGH[side]] = rotation.multiply(q["pelvis"], rotation.about(2, hip))
        q[SHANK[side]] = rotation.multiply(q[THIGH[side]], rotation.about(2, -knee))
        q[FOOT[side]] = rotation.multiply(q[SHANK[side]], rotation.about(2, ankle))
        lateral = BODY.hip_width / 2 * (1 if side == "right" else -1)
        p[THIGH[side]] = p["pelvis"] + rotation.rotate(q["pelvis"], np.array([0.0, 0.0, lateral]))
        p[SHANK[side]] = p[THIGH[side]] + rotation.rotate(q[THIGH[side]], np.array([0.0, -BODY.thigh, 0.0]))
        p[FOOT[side]] = p[SHANK[side]] + rotation.rotate(q[SHANK[side]], np.array([0.0, -BODY.shank, 0.0]))
        for x in (-0.25, 0.75):
            point = rotation.rotate(q[FOOT[side]], np.array([x * BODY.foot, -BODY.ankle_height, 0.0]))
            lowest = np.minimum(lowest, p[FOOT[side]][:, 2] + point[:, 2])
    for place in p.values():
        place[:, 2] -= lowest
    valid = np.ones(len(t), bool) if lost is None else (t < lost[0]) | (t >= lost[1])
    contact: dict[Segment, Bools] = {
        FOOT[side]: (t / STRIDE_S + PHASE[side]) % 1.0 < FOOT_OFF for side in SIDES
    }
    return Poses(t, rate_hz, q, p, valid, contact, BODY, "kinematic")


def angles(duration_s: float = 12.0, rate_hz: float = 100.0) -> JointAngles:
    """Joint angles of the walk, small outside the sagittal plane, 5 % spread between strides."""
    t = np.arange(round(duration_s * rate_hz)) / rate_hz
    sway = 2 * np.pi * t / STRIDE_S
    out: dict[str, Floats] = {
        "pelvis_tilt": np.radians(2) * np.sin(2 * sway),
        "pelvis_obliquity": np.radians(4) * np.sin(sway),
    }
    for side in SIDES:
        k = SUFFIX[side]
        wobble = 1 + 0.05 * np.sin(0.7 * t + PHASE[side])
        hip, knee, ankle = (a * wobble for a in flexion(t, side))
        out |= {f"hip_flexion_{k}": hip, f"knee_flexion_{k}": knee, f"ankle_dorsiflexion_{k}": ankle}
        small = np.radians(5) * np.sin(sway + 2 * np.pi * PHASE[side])
        for name in ("hip_adduction", "hip_rotation", "knee_adduction", "knee_rotation"):
            out[f"{name}_{k}"] = small
        out |= {f"ankle_inversion_{k}": small, f"ankle_rotation_{k}": small}
    return JointAngles(t, out, dict.fromkeys(out, 0.1))


def events(duration_s: float = 12.0) -> GaitEvents:
    """Contacts of the walk at whole phases."""
    result = []
    for side in SIDES:
        for k in range(-1, int(duration_s / STRIDE_S) + 2):
            start = (k - PHASE[side]) * STRIDE_S
            for kind, t in (("ic", start), ("tc", start + FOOT_OFF * STRIDE_S)):
                if 0 <= t < duration_s:
                    name: EventKind = "ic" if kind == "ic" else "tc"
                    result.append(GaitEvent(t, side, name, "foot_contact", t, uncertainty_s=0.02))
    return GaitEvents(tuple(sorted(result, key=lambda e: e.time_s)))


def strides(duration_s: float = 12.0) -> Strides:
    """Stride list of the walk; the first stride of each side is left out."""
    contacts = events(duration_s)
    out = []
    for side in SIDES:
        ic = contacts.times(side, "ic")
        other_side: Side = "right" if side == "left" else "left"
        for k, (a, b) in enumerate(itertools.pairwise(ic)):
            out.append(
                Stride(
                    side=side,
                    start_s=a,
                    tc_s=_inside(contacts.times(side, "tc"), a, b),
                    end_s=b,
                    opposite_tc_s=_inside(contacts.times(other_side, "tc"), a, b),
                    opposite_ic_s=_inside(contacts.times(other_side, "ic"), a, b),
                    turn_rad=0.01,
                    excluded_reason="first" if k == 0 else None,
                )
            )
    return Strides(tuple(sorted(out, key=lambda s: s.start_s)))


def tracks(duration_s: float = 12.0) -> Tracks:
    """What strides and parameters of the walk are measured on; the foot that carries rests."""
    result = poses(duration_s)
    whole = dict.fromkeys(SIDES, result.valid)
    feet = FootTracks(
        t_s=result.t_s,
        rate_hz=result.rate_hz,
        p={side: result.p[FOOT[side]] for side in SIDES},
        q={side: result.q[FOOT[side]] for side in SIDES},
        still={side: _flat(result, side) for side in SIDES},
        valid=whole,
        linked=True,
        source="kinematic",
        body=BODY,
    )
    return Tracks(
        t_s=result.t_s,
        rate_hz=result.rate_hz,
        events=events(duration_s),
        q={FOOT[side]: result.q[FOOT[side]] for side in SIDES},
        valid={FOOT[side]: result.valid for side in SIDES},
        turning=np.zeros(len(result.t_s), bool),
        feet=feet,
        angles=angles(duration_s),
        trunk={"pelvis": np.stack((0 * result.t_s, 0 * result.t_s, np.sin(result.t_s)), axis=1)},
    )


def _flat(result: Poses, side: Side) -> Bools:
    """The middle of the stance."""
    phase = (result.t_s / STRIDE_S + PHASE[side]) % 1.0
    return (phase > 0.15) & (phase < 0.35)


def _inside(times: tuple[float, ...], start: float, end: float) -> float | None:
    return next((t for t in times if start <= t < end), None)
