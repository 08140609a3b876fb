"""Forward kinematics: orientations and lengths → poses of a walking body, anchored by the supporting foot.

The chain gives every point relative to the pelvis. The contact point on the floor does not move: the pelvis
position integrates the negative velocity of the sole point in contact, so that there is never a jump; its
height puts the lowest sole point in contact at z = 0 at every moment, so that height does not drift. The sole
rolls: of heel and ball the lower one is the contact point, with smooth blending. Horizontal drift is that of
the relative chain and is not corrected: positions are for visualisation, stride lengths require an estimator
(docs/science/body-model.md, "Figure without a filter").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sagittal.core.body.model import LEG_FRACTION, NOMINAL_HEIGHT_M, BodyModel
from sagittal.core.body.places import FOOT as SENSOR_ON_FOOT
from sagittal.core.body.poses import Poses
from sagittal.core.errors import Notice
from sagittal.core.estimators import NO_FIGURE, ORIENTATIONS_ONLY
from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Bools, Floats, Segment, Side
from sagittal.core.message import Message
from sagittal.core.rotation import rotate
from sagittal.core.subject.anthropometry import BodyMeasures
from sagittal.core.subject.shoe import Shoe

if TYPE_CHECKING:
    # the package brings numba, which readers of results do without
    from sagittal.core.fusion.orientations import Orientations

HEEL, BALL = -0.21, 0.53
"""Heel and ball contact points in front of the ankle as fractions of foot length: the −.055 and .14 m of the
walker at a foot of .265 m."""


@dataclass(frozen=True)
class AnchorParams:
    """Smoothing of the transition between contact points (our choice, for visualisation).

    Parameters
    ----------
    blend_s : time over which the weight shifts from foot to foot. soft_m : height difference over which the
        weight shifts between heel and ball, and between feet without known contacts.
    """

    blend_s: float = 0.10
    soft_m: float = 0.01


def nominal_body(
    height_m: float | None,
    standing_width_m: float | None = None,
    shoe: Shoe | None = None,
    measures: BodyMeasures | None = None,
) -> tuple[BodyModel, tuple[Notice, ...]]:
    """Body model from height in m and measured lengths, with a notice `height_assumed` without a height.

    Without a height it is derived from a measured leg length, else 1.70 m is assumed.
    """
    leg_m = None if measures is None else measures.leg_m
    assumed_m = NOMINAL_HEIGHT_M if leg_m is None else leg_m / LEG_FRACTION
    body = replace(BodyModel.from_height(height_m or assumed_m, measures), standing_width=standing_width_m)
    if shoe is not None:
        # what the nominal place of the sensor is wrong by is wrong in the ankle's path, too, and cancels
        back, front = shoe.back_m - SENSOR_ON_FOOT[0], shoe.front_m + SENSOR_ON_FOOT[0]
        body = replace(body, sole_back=back, sole_front=front, sole_tip_up=shoe.tip_up_m)
    if height_m is not None:
        return body, ()
    message = Message(
        "Body height is missing; the avatar is drawn with {assumed_m:.2f} m. Enter the height for true "
        "proportions and distances; joint angles do not depend on it.",
        assumed_m=assumed_m,
    )
    return body, (Notice("height_assumed", message, severity="info"),)


def forward_kinematics(
    orientations: Orientations,
    body: BodyModel,
    contacts: Mapping[Side, Bools] | None = None,
    params: AnchorParams | None = None,
) -> Poses:
    """Place the pelvis and every complete leg in W.

    Parameters
    ----------
    contacts : side → (n,) True while that foot is on the floor (contacts.contact_mask); without it the lower
        foot is the supporting one.

    Returns
    -------
    Poses of the pelvis and of the legs with thigh, shank and foot; `figure_incomplete` lists omitted parts
    with reasons. Without the pelvis or without any complete leg `p` and `q` are empty.
    """
    params = params or AnchorParams()
    n = len(orientations.t_s)
    legs = [s for s in SIDES if all(x in orientations.q for x in (THIGH[s], SHANK[s], FOOT[s]))]
    notices = incomplete_legs(orientations, legs)
    if "pelvis" not in orientations.q or not legs:
        return Poses(
            orientations.t_s,
            orientations.rate_hz,
            {},
            {},
            np.zeros(n, bool),
            {},
            body,
            NO_FIGURE,
            notices=notices,
        )
    q: dict[Segment, Floats] = {"pelvis": orientations.q["pelvis"]}
    relative: dict[Segment, Floats] = {"pelvis": np.zeros((n, 3))}
    soles: list[Floats] = []
    for side in legs:
        q |= {x: orientations.q[x] for x in (THIGH[side], SHANK[side], FOOT[side])}
        hip, knee, ankle = leg_points(q, body, side)
        relative |= {THIGH[side]: hip, SHANK[side]: knee, FOOT[side]: ankle}
        soles += [ankle + rotate(q[FOOT[side]], np.array(p)) for p in sole_points(body)]
    valid = np.logical_and.reduce([orientations.valid[s] for s in q])
    carrying = {s: (contacts or {}).get(s, np.ones(n, bool)) for s in legs}
    if contacts is not None and len(legs) == 2:
        carrying = _somebody_carries(carrying)
    travel = _travel(np.stack(soles), carrying, orientations.rate_hz, params)
    p = {s: x + travel for s, x in relative.items()}
    return Poses(
        t_s=orientations.t_s,
        rate_hz=orientations.rate_hz,
        q=q,
        p=p,
        valid=valid,
        contact={FOOT[s]: carrying[s] for s in legs},
        body=body,
        method=ORIENTATIONS_ONLY.method,
        notices=notices,
    )


def leg_points(q: Mapping[Segment, Floats], body: BodyModel, side: Side) -> tuple[Floats, Floats, Floats]:
    """Hip, knee and ankle centres (n, 3) of a leg relative to mid-hip, in W."""
    lateral = 0.5 * body.hip_width * (1.0 if side == "right" else -1.0)
    hip = rotate(q["pelvis"], np.array([0.0, 0.0, lateral]))
    knee = hip + rotate(q[THIGH[side]], np.array([0.0, -body.thigh, 0.0]))
    ankle = knee + rotate(q[SHANK[side]], np.array([0.0, -body.shank, 0.0]))
    return hip, knee, ankle


def sole_points(body: BodyModel) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Heel and ball contact points in foot axes, origin at the ankle centre."""
    return (HEEL * body.foot, -body.ankle_height, 0.0), (BALL * body.foot, -body.ankle_height, 0.0)


def _travel(soles: Floats, carrying: Mapping[Side, Bools], rate_hz: float, params: AnchorParams) -> Floats:
    """Position (n, 3) of mid-hip in W from the sole points (2 legs × heel, ball; n, 3) relative to it."""
    from scipy.ndimage import uniform_filter1d

    width = max(1, round(params.blend_s * rate_hz))
    height = soles[..., 2]
    low = np.exp(-np.clip((height - height.min(axis=0)) / params.soft_m, 0.0, 50.0))
    carried = np.repeat(np.stack(list(carrying.values())), 2, axis=0)
    weight = np.where(carried, low, 0.0)
    # a swinging leg alone in the figure carries nothing: the speed of the last stance is kept until the next
    borne = weight.sum(axis=0) > 1e-6
    if not borne.any():
        weight, borne = low, np.ones(len(borne), bool)
    index = np.arange(len(borne))
    weight = weight / np.where(borne, weight.sum(axis=0), 1.0)
    velocity = -(weight[..., None] * np.gradient(soles, 1.0 / rate_hz, axis=1)).sum(axis=0)
    z = -(weight * height).sum(axis=0)
    series = np.column_stack((velocity[:, :2], z))
    if not borne.all():
        series = np.column_stack([np.interp(index, index[borne], x[borne]) for x in series.T])
    for _ in range(2):
        series = uniform_filter1d(series, width, axis=0, mode="nearest")
    travel = np.empty_like(series)
    travel[:, :2] = np.cumsum(series[:, :2], axis=0) / rate_hz
    travel[:, :2] -= travel[0, :2]
    travel[:, 2] = series[:, 2]
    return travel


def _somebody_carries(carrying: Mapping[Side, Bools]) -> dict[Side, Bools]:
    """Make either foot a candidate for support where both would be in swing: walking has no flight phase."""
    nobody = ~np.logical_or.reduce(list(carrying.values()))
    return {s: c | nobody for s, c in carrying.items()}


def incomplete_legs(orientations: Orientations, legs: list[Side]) -> tuple[Notice, ...]:
    """Notices `figure_incomplete` for sensors that do not contribute to these legs."""
    notices = []
    if "pelvis" not in orientations.q:
        message = "No avatar: the legs cannot be placed without a pelvis sensor; attach one."
        notices.append(Notice("figure_incomplete", message, sensor="pelvis"))
    for side in SIDES:
        missing = [x for x in (THIGH[side], SHANK[side], FOOT[side]) if x not in orientations.q]
        if side not in legs and len(missing) < 3:
            message = Message(
                "The {side} leg is missing from the avatar because there is no sensor on {missing}.",
                side=side,
                missing=" and ".join(missing),
            )
            notices.append(Notice("figure_incomplete", message, sensor=missing[0]))
    return tuple(notices)
