"""L7S: seven bodies from three IMUs (pelvis and feet) or from two (feet), Sy et al. 2021.

Sy, Lovell, Redmond 2021, IEEE Sensors Journal (docs/science/l7s.md): a constrained Kalman filter on SE(3)³ ×
R⁹. The state is the pose and velocity of pelvis and feet; thighs and shanks follow from hinged knees and
ankles. Differences from the printed paper (evidence: docs/science/l7s.md, "Departures from the paper"):

- eq 18: the feet's blocks of the mid-pelvis row are −½; the minus is missing in print.
- eq 32: the ankle is at −d/2 on the foot's z axis, which points to the toe; the paper has +.
- eq 20: σ is a variance; it jumps to 10 m² at toe-off and decays from the last flagged sample on, not below
  1e-4 m², which is also its value while a step is flagged (missing in print).
- eq 6: `adjoint="printed"` keeps the paper's Ad(+Ω) with the C of the authors' program; the derivation gives
  Ad(−Ω) and with the full C no term at all: `"exact"`. Only the printed form is stable if the headings of the
  feet disagree by more than about 3°, so it is the default.
- eq 7: 𝒢 adds acceleration noise to the position as if that were in world axes; with this local error it is
  in body axes, so its covariance with velocity is rotated by Rᵀ. Otherwise the result would depend on the
  walking direction in W.
- two projections onto the constraints instead of one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from sagittal.core.body.l7s.legs import HIP_SIDE, LEGS, LegModel
from sagittal.core.errors import EstimationError, ParameterError
from sagittal.core.frames import FOOT, Bools, Floats
from sagittal.core.message import Message
from sagittal.core.rotation import about, to_matrix, wrap_angle

Worn = Literal["3I", "2I"]
"""3I: pelvis and both feet carry an IMU; 2I: the feet only."""

Adjoint = Literal["printed", "exact"]

SIZE: Final = 27
"""Length of the error vector (ρ φ of pelvis, left foot, right foot; ν of the three)."""

HEADING_LIMIT: Final = np.pi / 2
"""Headings of the worn sensors that are further apart at the start are refused
(docs/science/l7s.md, "Start")."""


@dataclass(frozen=True)
class L7sParams:
    """Variances of Sy 2021, table III; all are variances, not standard deviations.

    Parameters
    ----------
    adjoint : see the module. projections : onto the constraints per step (paper: 1).
    acceleration : m²/s⁴. orientation_step : rad² added per step, σ_ω²Δt² = 1e7 · 1e-4 at any rate, so that
        the orientation is effectively replaced by that of the orientation filter at each step. orientation :
        rad².
    mid_pelvis, pelvis_height : m². yaw : rad² (2I only). zero_velocity : m²/s².
    foot_swing : m² at toe-off; foot_floor : m² while a step is flagged, and minimum; decay_s : λ of eq 20.
    start : every diagonal entry of P at the first sample.
    """

    adjoint: Adjoint = "printed"
    projections: int = 2
    acceleration: float = 100.0
    orientation_step: float = 1e3
    orientation: float = 10.0
    mid_pelvis: float = 1.0
    pelvis_height: float = 1.0
    yaw: float = 0.1
    zero_velocity: float = 1e-2
    foot_swing: float = 10.0
    foot_floor: float = 1e-4
    decay_s: float = 1.0
    start: float = 0.5

    def __post_init__(self) -> None:
        if self.adjoint not in ("printed", "exact"):
            raise ParameterError(
                "adjoint_unknown",
                Message("adjoint is '{adjoint}', expected printed or exact.", adjoint=self.adjoint),
            )
        if not 0 <= self.projections <= 10:
            raise ParameterError(
                "projections_range",
                Message("{projections} projections are outside 0 to 10.", projections=self.projections),
            )
        for name, value in vars(self).items():
            if isinstance(value, float) and not (np.isfinite(value) and value > 0.0):
                raise ParameterError(
                    "variance_range", Message("{name} = {value:g} is not above 0.", name=name, value=value)
                )


@dataclass(frozen=True, eq=False)
class L7sState:
    """Filter state carried from one sample to the next.

    Parameters
    ----------
    R : (3, 3, 3) of BODIES in Sy's frames. p, v : (3, 3) m, m/s, in W. P : (27, 27).
    since : (2,) number of samples since the last flagged step, left and right.
    """

    R: Floats
    p: Floats
    v: Floats
    P: Floats
    since: Floats


@dataclass(frozen=True, eq=False)
class L7sInputs:
    """A block of samples.

    Parameters
    ----------
    R : (n, 3, 3, 3) measured orientations of BODIES in Sy's frames (2I: those of the pelvis are ignored).
    acc : (n, 3, 3) accelerations in W without gravity, m/s². step : (n, 2) foot still, left and right.
    """

    R: Floats
    acc: Floats
    step: Bools
    worn: Worn

    def part(self, which: slice) -> L7sInputs:
        """A slice of the samples."""
        return L7sInputs(self.R[which], self.acc[which], self.step[which], self.worn)


@dataclass(frozen=True, eq=False)
class L7sTrack:
    """The constrained state after every sample; variance (n, 27) is the diagonal of P."""

    R: Floats
    p: Floats
    v: Floats
    variance: Floats

    def part(self, which: slice) -> L7sTrack:
        """A slice of the samples."""
        return L7sTrack(self.R[which], self.p[which], self.v[which], self.variance[which])


def filter_block(
    state: L7sState, inputs: L7sInputs, model: LegModel, rate_hz: float, params: L7sParams | None = None
) -> tuple[L7sTrack, L7sState]:
    """Process a block: predict, one stacked update, projections (Sy 2021 eq 3–39).

    Results are bit-identical for any division into blocks.

    Raises
    ------
    EstimationError `bad_signal` if an input is not finite, `l7s_diverged` if a constraint cannot be
    satisfied.
    """
    from sagittal.core.body.l7s import kernel
    from sagittal.core.body.l7s.updates import WIDTH

    params = params or L7sParams()
    R = np.ascontiguousarray(inputs.R, np.float64)
    acc = np.ascontiguousarray(inputs.acc, np.float64)
    step = np.ascontiguousarray(inputs.step, np.bool_)
    n = len(step)
    if R.shape != (n, 3, 3, 3) or acc.shape != (n, 3, 3) or step.shape != (n, 2):
        raise ParameterError(
            "bad_shape",
            Message(
                "L7S inputs have shapes {shape}, {shape2}, {shape3}; expected (n, 3, 3, 3), (n, 3, "
                "3), (n, 2).",
                shape=R.shape,
                shape2=acc.shape,
                shape3=step.shape,
            ),
        )
    bad = ~(np.isfinite(R).all(axis=(1, 2, 3)) & np.isfinite(acc).all(axis=(1, 2)))
    if bad.any():
        raise EstimationError(
            "bad_signal",
            Message(
                "Sample {int} of the block is not a number; mark it invalid or interpolate it.",
                int=int(np.argmax(bad)),
            ),
        )
    now = L7sState(*(np.array(x, np.float64, order="C") for x in vars(state).values()))
    track = L7sTrack(np.empty((n, 3, 3, 3)), np.empty((n, 3, 3)), np.empty((n, 3, 3)), np.empty((n, SIZE)))
    wide = np.zeros((WIDTH, WIDTH))
    wide[:SIZE, :SIZE] = now.P
    failed = kernel.run_l7s_kernel(
        now.R, now.p, now.v, wide.reshape(-1), np.zeros(WIDTH), now.since,
        R, acc, step, inputs.worn == "3I", 1.0 / rate_hz,
        np.array([0.5 * model.hip_width, 0.5 * model.foot, model.thigh + model.shank]),
        np.array([model.hip_height, model.foot_height]),
        np.array([
            params.orientation, params.mid_pelvis, params.pelvis_height, params.yaw, params.zero_velocity,
        ]),
        np.array([params.foot_swing, params.foot_floor, params.decay_s]),
        np.array([params.acceleration, params.orientation_step]),
        params.adjoint == "printed", params.projections, track.R, track.p, track.v, track.variance,
    )  # fmt: skip
    now.P[:] = wide[:SIZE, :SIZE]
    if failed >= 0 or not all(np.isfinite(x).all() for x in vars(now).values()):
        raise EstimationError(
            "l7s_diverged",
            Message(
                "The leg constraints cannot be met at sample {max} of the block; check which foot "
                "each sensor is on and the body height.",
                max=max(int(failed), 0),
            ),
        )
    return track, now


def start_l7s_state(inputs: L7sInputs, model: LegModel, params: L7sParams | None = None) -> L7sState:
    """The state at the first sample: upright standing, ankles below the hips, pelvis above the origin of W.

    Sy 2021 §III-A takes the start from Vicon; here it is the body model at the measured headings.

    Raises
    ------
    EstimationError `headings_apart` if the headings of the sensors differ by more than 90°.
    """
    R = np.array(inputs.R[0], np.float64)
    forward = R[1:, :2, 2].sum(axis=0)
    facing = float(np.arctan2(forward[1], forward[0]))
    if inputs.worn == "3I":
        facing = float(np.arctan2(R[0, 1, 0], R[0, 0, 0]))
    else:
        R[0] = to_matrix(about(2, facing))
    # in 2I the body faces between the feet: there they are compared with each other
    faces = [facing] if inputs.worn == "3I" else []
    for leg, side in enumerate(LEGS):
        faces.append(float(np.arctan2(R[1 + leg, 1, 2], R[1 + leg, 0, 2])))
        apart = abs(wrap_angle(faces[-1] - faces[0]))
        if apart > HEADING_LIMIT:
            reference = "body" if inputs.worn == "3I" else "left foot"
            raise EstimationError(
                "headings_apart",
                Message(
                    "The {side} foot points {apart:.0f}° away from the {other} at the start, which is "
                    "anatomically impossible. Check that no sensor is attached backwards and calibrate "
                    "again.",
                    side=side,
                    apart=np.degrees(apart),
                    other=reference,
                ),
                sensor=FOOT[side],
            )
    p = np.zeros((3, 3))
    p[0, 2] = model.hip_height
    for leg, side in enumerate(LEGS):
        lateral = 0.5 * HIP_SIDE[side] * model.hip_width
        hip = np.array([-lateral * np.sin(facing), lateral * np.cos(facing), model.ankle_height])
        p[1 + leg] = hip + 0.5 * model.foot * R[1 + leg, :, 2]
    P = (params or L7sParams()).start * np.eye(SIZE)
    return L7sState(R, p, np.zeros((3, 3)), P, np.zeros(2))
