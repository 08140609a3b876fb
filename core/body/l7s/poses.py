"""Seven poses from three IMUs or two by Sy's L7S; the filter is in core/body/l7s/filter.py.

A sparse mode of visibly lower accuracy: never take stride lengths from it where anything better is worn
(docs/science/l7s.md, "Limits").
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from core.body.l7s.checks import longest_gaps, walking_checks
from core.body.l7s.filter import L7sInputs, L7sParams, L7sState, L7sTrack, Worn, filter_block, start, warm
from core.body.l7s.health import l7s_health, told
from core.body.l7s.legs import BODIES, LEGS, LegModel, solve_legs
from core.body.model import BodyModel
from core.body.poses import Poses
from core.calibration.result import CalibratedRecording
from core.errors import EstimationError, Notice
from core.estimators import L7S_2I, L7S_3I
from core.frames import FOOT, GRAVITY, Bools, Floats, Segment, Side
from core.fusion.orientations import Orientations
from core.rotation import angle_between, from_matrix, rotate, to_matrix

__all__ = [
    "L7sInputs", "L7sParams", "L7sState", "L7sTrack", "LegModel", "Worn", "filter_block", "free_acceleration",
    "inputs_of", "l7s_poses", "start", "warm",
]  # fmt: skip

STRETCHED_M: Final = 1e-6
"""A leg this close to its full length is at the bound: the knee is within .2° of straight. The projection
leaves 1e-4 m too much with one pass, 1e-8 with two (docs/science/l7s.md, "Legs"); with this
margin the count is the same for any number of passes."""


def l7s_poses(
    orientations: Orientations,
    acceleration: Mapping[Segment, Floats],
    steps: Mapping[Side, Bools],
    body: BodyModel,
    params: L7sParams | None = None,
    worn: Worn | None = None,
) -> Poses:
    """Poses of the seven segments from pelvis and feet, or from the feet alone.

    Parameters
    ----------
    orientations : of the worn segments; others are not read.
    acceleration : segment → (n, 3) in W without gravity, m/s² (`free_acceleration`).
    steps : side → (n,) foot still on the floor: zero velocity, not contact.
    worn : None = 3I with a pelvis, else 2I.

    Returns
    -------
    Poses in ISB frames, method of L7S-3I or L7S-2I, `contact` = steps. After a loss of a foot they are valid
    again from its next rest on: until then nobody knows where it went. The feet's orientation is that of the
    constrained state and differs from the measured one by some degrees (docs/science/l7s.md, "Constraints").
    Diagnostics by side: `knee_straight_share`, samples with a foot in motion at which the leg is at its full
    length, so that the knee is a bound and no measurement; `hinge_m`, `excess_m`, largest residuals of the
    constraints; `step_share`; `foot_turned_rad`, mean angle from measured to reported.
    At the end: `position_sd_m` by body, `min_eigenvalue` of P. By sensor: `gap_s`, the longest loss.
    And those of `walking_checks`. Health and notices as of health.py; a notice `foot_never_still` when a
    foot has no step.

    Raises
    ------
    EstimationError `sensor_missing`, `segment_length`, `headings_apart`, `bad_signal`, `l7s_diverged`.
    """
    params = params or L7sParams()
    worn = worn or ("3I" if "pelvis" in orientations.q else "2I")
    model = LegModel.of(body)
    inputs = inputs_of(orientations, acceleration, steps, model, worn)
    track, state = filter_block(start(inputs, model, params), inputs, model, orientations.rate_hz, params)
    legs = solve_legs(track.R, track.p, model)
    length = model.thigh + model.shank
    moving = ~inputs.step.all(axis=1) | inputs.step.all()
    turned = angle_between(
        from_matrix(track.R[:, 1:].reshape(-1, 3, 3)), from_matrix(inputs.R[:, 1:].reshape(-1, 3, 3))
    ).reshape(-1, 2)
    variances = np.diag(state.P)[:18].reshape(3, 6)[:, :3]
    measured = BODIES if worn == "3I" else BODIES[1:]
    poses = Poses(
        t_s=orientations.t_s,
        rate_hz=orientations.rate_hz,
        q={"pelvis": from_matrix(track.R[:, 0] @ model.to_isb("pelvis")), **legs.q},
        p={"pelvis": track.p[:, 0], **legs.p},
        valid=_known(orientations, inputs.step, measured),
        contact={FOOT[s]: np.asarray(steps[s], bool) for s in LEGS},
        body=body,
        method=(L7S_3I if worn == "3I" else L7S_2I).method,
        notices=_never_still(steps),
        diagnostics={
            "adjoint": params.adjoint,
            "knee_straight_share": {
                s: float(np.mean((legs.reach[s] > length - STRETCHED_M)[moving])) for s in LEGS
            },
            "hinge_m": {s: float(np.abs(legs.hinge[s]).max()) for s in LEGS},
            "excess_m": {s: float(np.maximum(legs.reach[s] - length, 0.0).max()) for s in LEGS},
            "step_share": {s: float(np.mean(steps[s])) for s in LEGS},
            "foot_turned_rad": {s: float(turned[:, i].mean()) for i, s in enumerate(LEGS)},
            "position_sd_m": {s: float(np.sqrt(x.max())) for s, x in zip(BODIES, variances, strict=True)},
            "min_eigenvalue": float(np.linalg.eigvalsh(state.P)[0]),
            "gap_s": longest_gaps({s: orientations.valid[s] for s in measured}, orientations.rate_hz),
            **walking_checks(inputs, track, model, orientations.rate_hz),
        },
    )
    health = l7s_health(poses)
    return replace(poses, health=health, notices=(*poses.notices, *told(health)))


def free_acceleration(calibrated: CalibratedRecording, orientations: Orientations) -> dict[Segment, Floats]:
    """Accelerations (n, 3) of the sensors with an orientation, in W without gravity, m/s²; zero while lost.

    What the accelerometer's norm at rest differs from G is taken off as a bias along the segment's axis that
    is vertical at rest, not as a scale (docs/science/calibration.md, "Standing").
    """
    found: dict[Segment, Floats] = {}
    for segment, q in orientations.q.items():
        mounted = calibrated.calibration.segments[segment]
        signals = calibrated.recording.sensors[segment]
        force = signals.acc @ mounted.R_segment_sensor.T
        force[:, 1] -= mounted.rest_norm - GRAVITY
        world = rotate(q, force)
        world[:, 2] -= GRAVITY
        found[segment] = np.where(signals.valid[:, None], world, 0.0)
    return found


def inputs_of(
    orientations: Orientations,
    acceleration: Mapping[Segment, Floats],
    steps: Mapping[Side, Bools],
    model: LegModel,
    worn: Worn,
) -> L7sInputs:
    """Bring orientations, accelerations and steps into the filter's order and frames.

    Raises
    ------
    EstimationError `sensor_missing` when a worn body has no orientation, acceleration or steps.
    """
    needed = BODIES if worn == "3I" else BODIES[1:]
    for segment in needed:
        if segment not in orientations.q or segment not in acceleration:
            raise EstimationError(
                "sensor_missing",
                f"L7S-{worn} needs {', '.join(needed)}; nothing of {segment}. Wear or map a sensor there.",
                sensor=segment,
            )
    for side in LEGS:
        if side not in steps:
            raise EstimationError(
                "sensor_missing",
                f"L7S needs to know when the {side} foot is still; give its step flags.",
                sensor=FOOT[side],
            )
    n = len(orientations.t_s)
    R, acc = np.tile(np.eye(3), (n, 3, 1, 1)), np.zeros((n, 3, 3))
    for b, segment in enumerate(BODIES):
        if segment in needed:
            R[:, b] = to_matrix(orientations.q[segment]) @ model.to_isb(segment).T
            acc[:, b] = acceleration[segment]
    if worn == "2I":
        acc[:, 0] = 0.5 * (acc[:, 1] + acc[:, 2])
    return L7sInputs(R, acc, np.stack([steps[side] for side in LEGS], axis=1), worn)


def _known(orientations: Orientations, step: Bools, measured: Sequence[Segment]) -> Bools:
    """Samples (n,) at which every worn sensor is there and no foot is on its way after a loss."""
    known = np.logical_and.reduce([orientations.valid[s] for s in measured])
    index = np.arange(len(step))
    for leg, side in enumerate(LEGS):
        there = orientations.valid[FOOT[side]]
        lost = np.maximum.accumulate(np.where(there, -1, index))
        rested = np.maximum.accumulate(np.where(there & step[:, leg], index, -1))
        known &= rested >= lost
    return np.asarray(known)


def _never_still(steps: Mapping[Side, Bools]) -> tuple[Notice, ...]:
    return tuple(
        Notice(
            "foot_never_still",
            f"The {side} foot is never still in this take, so nothing bounds its speed; positions and step "
            "lengths mean nothing. A treadmill or a sensor on another segment looks like this.",
            sensor=FOOT[side],
        )
        for side in LEGS
        if not np.any(steps[side])
    )
