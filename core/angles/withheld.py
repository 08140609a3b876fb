"""Suppression of angles and distances from unreliable estimates.

Estimators report how consistent their result is (core/body/health.py). Where consistency is bad, the angles
of the joint concerned would still look plausible; they are removed with the reason `estimator_bad`. So are
distances of feet on an inconsistent chain; those of a foot whose path contradicts its own rest phases have
the reason `path_bad`. Angles that a leg model holds constant are no results either and are removed with
`fixed_by_model`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from sagittal.core.angles import SIGNS, JointAngles, list_leg_joints
from sagittal.core.body.estimate import PoseEstimate
from sagittal.core.body.health import HealthFinding
from sagittal.core.body.poses import Poses
from sagittal.core.errors import Notice
from sagittal.core.estimators import BY_METHOD
from sagittal.core.frames import FOOT, SIDES, SUFFIX, Oriented, Segment, Side
from sagittal.core.message import Message
from sagittal.core.rotation import wrap_angle
from sagittal.core.signals.rest import Window, find_runs

BAD: Final = "estimator_bad"
"""Reason of an angle whose estimator contradicts itself at that joint."""

PATH: Final = "path_bad"
"""Reason of distances of a foot whose path does not fit its own rests: one sensor is enough for that."""

FIXED: Final = "fixed_by_model"
"""Reason of an angle that the model of the leg holds where it is: its zero is no measurement."""

OF_JOINT: Final = ("joint_residual_mm",)
"""Findings of a joint, "proximal-distal"."""

OF_SEGMENT: Final = ("forward_axis_turned_deg", "start_heading_off_deg")
"""Findings of a segment: its joints, and a pelvis's own angles."""

OF_LEG: Final = ("leg_excess_mm", "hinge_mm", "longest_moving_s", "knee_straight_pct")
"""Findings of a leg or its foot: what the model of the leg estimates of it."""

OF_TAKE: Final = (
    "feet_out_of_place_pct", "phase_off_pct", "toward_foot_mps2", "inner_foot_m", "pelvis_tilt_sd_deg",
    "pelvis_rise_cm", "places_moved_mm",
)  # fmt: skip
"""Findings of the whole take: all that the model of the legs estimates."""

OF_PATH: Final = ("zero_velocity_refused_pct",)
"""Findings of the path of a foot."""

AFTER_GAP_S: Final = 10.0
"""For so long after a loss what the model of the leg says of it is doubtful (core/body/l7s/health.py): a foot
whose sensor was gone for 1 s can come back with another heading."""


def withhold(angles: JointAngles, poses: Poses, orientations: Oriented) -> JointAngles:
    """Suppress angles of joints whose estimate is bad and those held constant by the leg model.

    Parameters
    ----------
    poses : with the health checks of the run. orientations : of the sensors, for their periods of data loss.

    Returns
    -------
    JointAngles without them; `withheld` has their reasons, `bounds` the straight knee of a leg model that an
    estimated knee cannot extend past; a notice `angles_withheld` names the inconsistent joints.
    """
    estimated = frozenset(map(str, angles.diagnostics.get("estimated", ())))  # type: ignore[call-overload]
    estimator = BY_METHOD.get(poses.method)
    fixed = list_fixed(poses) & estimated & set(angles.zero_offset)
    bad = [f for f in poses.health if f.verdict == "bad"]
    out = {name for f in bad for name in _concerned(f, estimated) if name in angles.angles} - fixed
    retained = {name: x for name, x in angles.angles.items() if name not in out | fixed}
    for f in bad:
        side = _foot_side(f.of)
        if f.name == "gap_s" and f.bad is not None and side is not None and FOOT[side] in orientations.valid:
            long = _after_gaps(orientations, side, f.bad)
            for name in retained:
                if name in estimated and name.endswith(f"_{SUFFIX[side]}"):
                    retained[name] = np.where(long, np.nan, retained[name])
    modelled = estimator is not None and estimator.leg_model
    bounds = {
        name: wrap_angle(float(-angles.zero_offset[name]))
        for name in retained
        if modelled and name in estimated and name.startswith("knee_flexion")
    }
    notices = angles.notices
    if out:
        places = sorted({_place(name) for name in out})
        message = Message(
            "Angles of {places} are not reported because the sensors contradict each other. Check sides, "
            "segments and alignment, then calibrate again.",
            places=", ".join(places),
        )
        notices = (*notices, Notice("angles_withheld", message))
    return replace(
        angles,
        angles=retained,
        withheld={name: BAD if name in out else FIXED for name in sorted(out | fixed)},
        bounds=bounds,
        notices=notices,
    )


def withhold_at_slips(angles: JointAngles, doubtful: Mapping[Segment, Window]) -> JointAngles:
    """Suppress the angles adjacent to a sensor while its alignment is uncertain after a slip.

    Parameters
    ----------
    doubtful : sensor → period, s from recording start (core/agreement).
    """
    retained = dict(angles.angles)
    for side in SIDES:
        for joint, *ends in list_leg_joints(side):
            out = np.zeros(len(angles.t_s), np.bool_)
            for start, end in (doubtful[s] for s in ends if s in doubtful):
                out |= (angles.t_s >= start) & (angles.t_s <= end)
            for base, _, _ in SIGNS[joint]:
                if (name := f"{base}_{SUFFIX[side]}") in retained:
                    retained[name] = np.where(out, np.nan, retained[name])
    return replace(angles, angles=retained)


def withhold_distances(posed: PoseEstimate) -> PoseEstimate:
    """Suppress distances of feet whose estimated paths are unreliable.

    Returns
    -------
    PoseEstimate with the reasons in `feet.withheld` and a notice `distances_withheld` naming the feet. On a
    single chain one wrong joint displaces both feet.
    """
    feet = posed.feet
    if feet is None:
        return posed
    bad = [f for f in posed.poses.health if f.verdict == "bad"]
    chain = feet.linked and any(f.name in OF_JOINT or f.name in OF_SEGMENT for f in bad)
    off = {f.of for f in bad if f.name in OF_PATH}
    out = [side for side in SIDES if side in feet.p and (chain or FOOT[side] in off)]
    if not out:
        return posed
    whose = "both feet" if len(out) > 1 else f"the {out[0]} foot"
    reason, todo = (
        ("the path does not fit the sensors", "Check sides, segments, mounting and lost samples")
        if chain
        else ("the path does not fit its rests on the floor", "Fasten the sensor and check for lost samples")
    )
    message = Message(
        "Distances of {whose} are not reported: {why}. {todo}, then record again.",
        whose=whose,
        why=reason,
        todo=todo,
    )
    notices = (*posed.poses.notices, Notice("distances_withheld", message))
    return replace(
        posed,
        poses=replace(posed.poses, notices=notices),
        feet=replace(feet, withheld=dict.fromkeys(out, BAD if chain else PATH)),
    )


def _concerned(f: HealthFinding, estimated: frozenset[str]) -> Iterator[str]:
    """Names of the angles affected by a bad health check."""
    subject = f.of or ""
    if f.name in OF_JOINT or f.name in OF_SEGMENT:
        ends = set(subject.split("-"))
        for side in SIDES:
            for joint, proximal, distal in list_leg_joints(side):
                # of a joint both ends are named, of a segment one
                if ends <= {proximal, distal}:
                    yield from (f"{base}_{SUFFIX[side]}" for base, _, _ in SIGNS[joint])
        if subject == "pelvis":
            yield from ("pelvis_tilt", "pelvis_obliquity")
    elif f.name in OF_LEG:
        yield from (name for name in estimated if name.endswith(f"_{subject[-1:]}"))
    elif f.name in OF_TAKE:
        yield from estimated


def list_fixed(poses: Poses) -> frozenset[str]:
    """Angles held constant by the estimator's leg model, where they are not measured by two sensors."""
    estimator = BY_METHOD.get(poses.method)
    variables = () if estimator is None else estimator.fixed
    return frozenset(x for v in variables for x in (v, *(f"{v}_{end}" for end in SUFFIX.values())))


def _foot_side(subject: str | None) -> Side | None:
    return next((side for side in SIDES if FOOT[side] == subject), None)


def _after_gaps(orientations: Oriented, side: Side, least_s: float) -> np.ndarray:
    """Samples (n,) during a data loss of a foot longer than `least_s` or within `AFTER_GAP_S` of its end."""
    t_s, valid = orientations.t_s, orientations.valid[FOOT[side]]
    long = np.zeros(len(valid), np.bool_)
    for start, stop in find_runs(~valid):
        end_s = float(t_s[stop - 1])
        if end_s - float(t_s[start]) > least_s:
            long |= (t_s >= t_s[start]) & (t_s <= end_s + AFTER_GAP_S)
    return long


def _place(name: str) -> str:
    joint = name.split("_")[0]
    side = next((side for side in SIDES if name.endswith(f"_{SUFFIX[side]}")), None)
    return joint if side is None else f"the {side} {joint}"
