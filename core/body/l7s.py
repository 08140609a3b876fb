"""L7S: seven bodies from three IMUs (pelvis and feet) or from two (feet), Sy et al. 2021.

Sy, Lovell, Redmond 2021, IEEE TBME (spec/estimators.md §4): a constrained Kalman filter on SE(3)³ × R⁹. The
state is the pose and velocity of pelvis and feet; thighs and shanks follow from hinged knees and ankles.
What we do otherwise than the paper prints, each checked against finite differences or simulation:

- eq 18: the feet's blocks of the mid-pelvis row carry −½, the minus is lost in print.
- eq 32: the ankle lies at −d/2 on the foot's z axis, which points to the toe; print has +.
- eq 20: σ there is a variance; it jumps to 10 m² at toe-off and decays from the last flagged sample on, not
  below 1e-4 m², which is also its value while a step is flagged (missing in print).
- eq 6: `adjoint="printed"` keeps the paper's Ad(+Ω) with the C of the authors' program; the derivation gives
  Ad(−Ω) and with the full C no term at all: `"exact"`. The printed form is measurably better and is default.
- eq 7: 𝒢 puts acceleration noise into the position as if that were in world axes; in this right-invariant
  error it is in body axes, so its covariance with velocity is turned by Rᵀ. Otherwise the result would depend
  on which way the person walks in the world.
- two projections onto the constraints instead of one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from core.body.l7s_legs import BODIES, HINGE_SIDE, LEGS, LegModel, solve_legs
from core.body.model import BodyModel
from core.body.poses import Poses
from core.calibration.result import CalibratedRecording
from core.errors import EstimationError, Notice, ParameterError
from core.frames import FOOT, GRAVITY, Bools, Floats, Segment, Side
from core.fusion.orientations import Orientations
from core.rotation import about, rotate, to_matrix, yaw

Worn = Literal["3I", "2I"]
"""3I: pelvis and both feet carry an IMU; 2I: the feet only."""

Adjoint = Literal["printed", "exact"]

SIZE: Final = 27
"""Length of the error vector (ρ φ of pelvis, left foot, right foot; ν of the three)."""

HEADING_LIMIT: Final = np.pi / 2
"""Headings of the worn sensors that are further apart at the start are refused (spec/estimators.md §3.5)."""

CLIP_WARN: Final = 0.3
"""Share of straight-clipped knees that is told: with one projection 30 % are normal, with two 4 % (§4.5)."""


@dataclass(frozen=True)
class L7sParams:
    """Variances of Sy 2021, table III; all are variances, not standard deviations.

    Parameters
    ----------
    adjoint : see the module. projections : onto the constraints per step (paper: 1).
    acceleration : m²/s⁴. orientation_step : rad² added per step, σ_ω²Δt² = 1e7 · 1e-4 at any rate, so that the
        orientation is taken anew from the orientation filter each step. orientation : rad².
    mid_pelvis, pelvis_height : m². yaw : rad² (2I only). zero_velocity : m²/s².
    foot_swing : m² at toe-off; foot_floor : m² while a step is flagged and at least; decay_s : λ of eq 20.
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
                "adjoint_unknown", f"adjoint is '{self.adjoint}', expected printed or exact."
            )
        if not 0 <= self.projections <= 10:
            raise ParameterError("projections_range", f"{self.projections} projections are outside 0 to 10.")
        for name, value in vars(self).items():
            if isinstance(value, float) and not (np.isfinite(value) and value > 0.0):
                raise ParameterError("variance_range", f"{name} = {value:g} is not above 0.")


@dataclass(frozen=True, eq=False)
class L7sState:
    """What the filter carries from one sample to the next.

    Parameters
    ----------
    R : (3, 3, 3) of BODIES in Sy's frames. p, v : (3, 3) m, m/s, in W. P : (27, 27).
    since : (2,) samples since the last flagged step, left and right.
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
    R : (n, 3, 3, 3) measured orientations of BODIES in Sy's frames (2I: the pelvis's are not read).
    acc : (n, 3, 3) accelerations in W without gravity, m/s². step : (n, 2) foot still, left and right.
    """

    R: Floats
    acc: Floats
    step: Bools
    worn: Worn

    def part(self, which: slice) -> L7sInputs:
        """Some of the samples."""
        return L7sInputs(self.R[which], self.acc[which], self.step[which], self.worn)


@dataclass(frozen=True, eq=False)
class L7sTrack:
    """The constrained state after every sample; variance (n, 27) is the diagonal of P."""

    R: Floats
    p: Floats
    v: Floats
    variance: Floats


def filter_block(
    state: L7sState, inputs: L7sInputs, model: LegModel, rate_hz: float, params: L7sParams | None = None
) -> tuple[L7sTrack, L7sState]:
    """Advance the filter over a block: predict, one stacked update, projections (Sy 2021 eq 3–39)."""
    raise NotImplementedError


def free_acceleration(calibrated: CalibratedRecording, orientations: Orientations) -> dict[Segment, Floats]:
    """Accelerations (n, 3) of the sensors in W without gravity, m/s²."""
    raise NotImplementedError


def l7s_poses(
    orientations: Orientations,
    acceleration: Mapping[Segment, Floats],
    steps: Mapping[Side, Bools],
    body: BodyModel,
    params: L7sParams | None = None,
    worn: Worn | None = None,
) -> Poses:
    """Poses of the seven segments from pelvis and feet, or from the feet alone."""
    raise NotImplementedError
