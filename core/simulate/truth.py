"""Ground truth: poses, angles, contacts and strides of a simulated recording.

Angles follow the sequence and signs of docs/reference/coordinate-systems.md, derived here independently from
the rotation matrices, so that a sign error in core/angles cannot hide.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sagittal.core.body.model import BodyModel
from sagittal.core.frames import FOOT, R_NEUTRAL, SHANK, SIDES, SUFFIX, THIGH, Bools, Floats, Segment, Side
from sagittal.core.rotation import to_matrix
from sagittal.core.simulate.gait.human import Motion
from sagittal.core.simulate.gait.timing import FootTiming
from sagittal.core.simulate.mems import DrawnErrors
from sagittal.core.simulate.script import Footprint
from sagittal.core.simulate.sensors import Mount
from sagittal.core.simulate.walker import SIGN

LIFT_M = 0.005
"""Foot off the floor as detectors see it: lowest sole point this high
(docs/science/simulation.md, "Timing")."""

ZERO_MARGIN_S = (0.5, 1.0)
"""Left out of the first standing, at its start and end, for the zero: the pelvis prepares the first step."""


@dataclass(frozen=True, eq=False)
class TrueContacts:
    """Exact events of one foot in s, one entry per swing.

    Parameters
    ----------
    heel_off, release : heel rise, end of contact. lift5 : lowest sole point exceeds 5 mm, NaN if never.
    contact : initial contact. flat : start of the flat and still phase, which lasts until the next heel-off.
    """

    heel_off: Floats
    release: Floats
    lift5: Floats
    contact: Floats
    flat: Floats


@dataclass(frozen=True)
class TrueStride:
    """One stride, initial contact to the next of the same foot, without standing in between.

    Parameters
    ----------
    release_s, lift5_s : end of contact by the two definitions; lift5_s is None if the sole never reaches 5
        mm.
    length_m : between the two footprints (ankle projected to the floor). width_m : distance of the other
        foot's footprint from that line. turn_rad : heading change of the foot, left positive.
    """

    side: Side
    start_s: float
    release_s: float
    lift5_s: float | None
    end_s: float
    length_m: float
    width_m: float
    turn_rad: float


@dataclass(frozen=True, eq=False)
class WalkTruth:
    """Exact ground truth at the samples of the recording.

    Parameters
    ----------
    t_s : (n,). q : segment → (n, 4), p : segment → (n, 3) m; origins as in core/body/poses.py.
    angles : name → (n,) rad as in core/angles, anatomical (not zeroed).
    zero : window in s of the first standing. zero_offset : name → its mean angle there, rad.
    contact : side → (n,) the foot touches the floor. flat : side → (n,) it is flat and exactly still.
    mounts, errors : segment → position and alignment of its sensor, and its constant errors. guard_m :
        largest lowering of the pelvis for a leg out of reach. lifts_m : side → lifts of the swings.
    """

    t_s: Floats
    rate_hz: float
    seed: int
    body: BodyModel
    q: Mapping[Segment, Floats]
    p: Mapping[Segment, Floats]
    angles: Mapping[str, Floats]
    zero: tuple[float, float]
    zero_offset: Mapping[str, float]
    stands: tuple[tuple[float, float], ...]
    contacts: Mapping[Side, TrueContacts]
    contact: Mapping[Side, Bools]
    flat: Mapping[Side, Bools]
    footprints: Mapping[Side, tuple[Footprint, ...]]
    strides: tuple[TrueStride, ...]
    mounts: Mapping[Segment, Mount]
    errors: Mapping[Segment, DrawnErrors]
    guard_m: float
    lifts_m: Mapping[Side, tuple[float, ...]]

    def subtract_standing(self) -> dict[str, Floats]:
        """Angles (n,) in rad minus their value in standing."""
        return {name: values - self.zero_offset[name] for name, values in self.angles.items()}


def truth_of(
    motion: Motion,
    every: int,
    mounts: Mapping[Segment, Mount],
    errors: Mapping[Segment, DrawnErrors],
    seed: int,
) -> WalkTruth:
    """Take every `every`-th sample of a motion as ground truth, with its events and strides."""
    t = motion.t_s[::every]
    q = {s: a[::every] for s, a in motion.q.items()}
    p = {s: a[::every] for s, a in motion.p.items()}
    angles = joint_angles(q)
    start, end = motion.plan.stands[0]
    margin = min(1.0, (end - start) / (2.0 * sum(ZERO_MARGIN_S)))
    zero = (start + margin * ZERO_MARGIN_S[0], end - margin * ZERO_MARGIN_S[1])
    standing = (t >= zero[0]) & (t < zero[1])
    contacts = {s: _contacts(motion, s) for s in SIDES}
    touching = {s: ~_between(t, contacts[s].release, contacts[s].contact) for s in SIDES}
    return WalkTruth(
        t_s=t,
        rate_hz=motion.rate_hz / every,
        seed=seed,
        body=motion.walker.anatomy.body_model(),
        q=q,
        p=p,
        angles=angles,
        zero=zero,
        zero_offset={name: float(values[standing].mean()) for name, values in angles.items()},
        stands=motion.plan.stands,
        contacts=contacts,
        contact=touching,
        flat={s: ~_between(t, contacts[s].heel_off, contacts[s].flat) for s in SIDES},
        footprints=motion.plan.footprints,
        strides=_strides(motion, contacts),
        mounts=mounts,
        errors=errors,
        guard_m=motion.guard_m,
        lifts_m=motion.lifts_m,
    )


def joint_angles(q: Mapping[Segment, Floats]) -> dict[str, Floats]:
    """Angles (n,) in rad of segment orientations (n, 4), names and signs as in core/angles.

    Parameters
    ----------
    q : the pelvis and one or both whole legs.
    """
    R = {segment: to_matrix(values) for segment, values in q.items()}
    relative = R_NEUTRAL.T @ R["pelvis"]
    out = {
        "pelvis_tilt": -np.arctan2(relative[:, 1, 0], relative[:, 1, 1]),
        "pelvis_obliquity": np.arcsin(relative[:, 1, 2]),
    }
    for side in (s for s in SIDES if FOOT[s] in q):
        mirror, end = SIGN[side], SUFFIX[side]
        hip = _cardan(R["pelvis"], R[THIGH[side]])
        knee = _cardan(R[THIGH[side]], R[SHANK[side]])
        ankle = _cardan(R[SHANK[side]], R[FOOT[side]])
        out |= {
            f"hip_flexion_{end}": hip[0],
            f"hip_adduction_{end}": mirror * hip[1],
            f"hip_rotation_{end}": mirror * hip[2],
            f"knee_flexion_{end}": -knee[0],
            f"knee_adduction_{end}": mirror * knee[1],
            f"knee_rotation_{end}": mirror * knee[2],
            f"ankle_dorsiflexion_{end}": ankle[0],
            f"ankle_inversion_{end}": mirror * ankle[1],
            f"ankle_rotation_{end}": mirror * ankle[2],
        }
    return out


def _cardan(proximal: Floats, distal: Floats) -> tuple[Floats, Floats, Floats]:
    """Angles a, b, c (n,) of proximalᵀ distal = Rz(a) Rx(b) Ry(c)
    (docs/science/joint-angles.md, "Joints")."""
    r = np.swapaxes(proximal, 1, 2) @ distal
    return (
        np.arctan2(-r[:, 0, 1], r[:, 1, 1]),
        np.arcsin(np.clip(r[:, 2, 1], -1.0, 1.0)),
        np.arctan2(-r[:, 2, 0], r[:, 2, 2]),
    )


def _contacts(motion: Motion, side: Side) -> TrueContacts:
    timing = motion.timings[side]
    return TrueContacts(
        timing.heel_off, timing.release, _lift5(motion, side, timing), timing.contact, timing.flat
    )


def _lift5(motion: Motion, side: Side, timing: FootTiming) -> Floats:
    """First time (swings,) after release with the sole 5 mm up, interpolated; NaN if never."""
    t, sole = motion.t_s, motion.sole_height[side]
    out = np.full(len(timing.release), np.nan)
    for i, (release, contact) in enumerate(zip(timing.release, timing.contact, strict=True)):
        first, last = np.searchsorted(t, (release, contact))
        lifted = np.flatnonzero(sole[first:last] > LIFT_M)
        if len(lifted):
            k = first + lifted[0]
            out[i] = t[k] - (sole[k] - LIFT_M) / (sole[k] - sole[k - 1]) * (t[k] - t[k - 1])
    return out


def _between(t: Floats, starts: Floats, ends: Floats) -> Bools:
    """Samples (n,) inside any of the half-open ranges [start, end)."""
    inside = np.zeros(len(t), bool)
    for start, end in zip(starts, ends, strict=True):
        inside[np.searchsorted(t, start) : np.searchsorted(t, end)] = True
    return inside


def _strides(motion: Motion, contacts: Mapping[Side, TrueContacts]) -> tuple[TrueStride, ...]:
    strides = []
    for side in SIDES:
        opposite_prints = motion.plan.footprints["left" if side == "right" else "right"]
        prints, events = motion.plan.footprints[side], contacts[side]
        for i in range(1, len(prints) - 1):
            a, b = prints[i], prints[i + 1]
            if motion.timings[side].paused[i]:
                continue
            along = np.array([b.x_m - a.x_m, b.y_m - a.y_m])
            length = float(np.hypot(*along))
            lift = float(events.lift5[i])
            opposite = next(f for f in reversed(opposite_prints) if f.time_s < b.time_s)
            off = np.array([opposite.x_m - a.x_m, opposite.y_m - a.y_m])
            # on the spot there is no line of progression: the distance between the feet is the width
            width = abs(along[0] * off[1] - along[1] * off[0]) / length if length > 0.05 else np.hypot(*off)
            strides.append(
                TrueStride(
                    side=side,
                    start_s=a.time_s,
                    release_s=float(events.release[i]),
                    lift5_s=None if np.isnan(lift) else lift,
                    end_s=b.time_s,
                    length_m=length,
                    width_m=float(width),
                    turn_rad=b.foot_rad - a.foot_rad,
                )
            )
    return tuple(sorted(strides, key=lambda s: s.start_s))
