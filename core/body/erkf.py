"""The error-state Kalman filter of Potter et al. 2021 for any tree of IMUs.

Every IMU is a free body with position, velocity and orientation of its accelerometer; what holds them together
are measurements: joint centres coincide (eq 21–23), hinge axes agree (eq 24–26), a foot on the floor does not
move (eq 15–17), gravity is where the accelerometer sees it (eq 18–20). Errors are local (right), Hamilton.

Where we differ from the paper: trapezoidal steps; the exact derivative of the step (the paper leaves out
δp/δθ); biases as states; process noise that follows impacts; a χ² gate on zero velocity; the blocks of one step
are taken one after the other, which with diagonal noise is the same as their stacked update; the reset Jacobian
(eq 27) is carried in the next step's transition. Source: spec/estimators.md §3, spec/kernels.md §3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.body.erkf_params import ErkfParams as ErkfParams
from core.body.tree import ImuTree
from core.errors import Notice
from core.frames import Bools, Floats


@dataclass(frozen=True, eq=False)
class ErkfInputs:
    """A block of samples of n IMUs in the tree's order.

    Parameters
    ----------
    step_s : (T,) time since the sample before; 0 for the very first.
    acc, gyr : (T, n, 3) m/s², rad/s, at rest |acc| = g. valid : (T, n) measured; elsewhere the last value is held.
    contact : (T, n) the sensor's foot rests on the floor. still : (T, n) the sensor has been at rest for 0.3 s.
    heading : (T, n) measured heading of the segment's forward axis in W, rad, NaN where none; None for none.
    """

    step_s: Floats
    acc: Floats
    gyr: Floats
    valid: Bools
    contact: Bools
    still: Bools
    heading: Floats | None = None

    def part(self, start: int, stop: int) -> ErkfInputs:
        """Samples start … stop − 1."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class ErkfState:
    """All that passes from one sample to the next.

    Parameters
    ----------
    nominal : (n, 16) per IMU p (3), v (3), q (4), gyro bias (3), accelerometer bias (3).
    P : (n·m, n·m) covariance of the errors (δp, δv, δθ[, δb_g, δb_a]) of each IMU.
    before : (n, 6) last sample's acc and gyr. injected : (n·m,) last correction, its reset still to be applied.
    refused : (n,) consecutive refused zero velocities.
    """

    nominal: Floats
    P: Floats
    before: Floats
    injected: Floats
    refused: Floats


@dataclass(frozen=True, eq=False)
class ErkfTrack:
    """What the filter or the smoother says at every sample.

    Parameters
    ----------
    nominal : (T, n, 16) as in `ErkfState`. heading_sd : (T, n) rad, of the filter, about the vertical.
    joint_residual : (T, joints) distance of the two ends of each joint, m.
    refused : (T, n) zero velocities that the gate refused.
    """

    nominal: Floats
    heading_sd: Floats
    joint_residual: Floats
    refused: Bools

    @property
    def p(self) -> Floats:
        """Sensor positions (T, n, 3) in W, m."""
        return self.nominal[..., 0:3]

    @property
    def v(self) -> Floats:
        """Sensor velocities (T, n, 3) in W, m/s."""
        return self.nominal[..., 3:6]

    @property
    def q(self) -> Floats:
        """Sensor orientations (T, n, 4)."""
        return self.nominal[..., 6:10]


@dataclass(frozen=True, eq=False)
class ErkfResult:
    """A whole recording.

    Parameters
    ----------
    diagnostics : the figures of spec/estimators.md §7 (see erkf_health.py), plain values.
    """

    track: ErkfTrack
    final: ErkfState
    notices: tuple[Notice, ...]
    diagnostics: dict[str, object]


def erkf_inputs(
    tree: ImuTree, acc: Floats, gyr: Floats, valid: Bools, rate_hz: float, heading: Floats | None = None
) -> ErkfInputs:
    """Inputs of a recording on a uniform axis: holds invalid samples, finds contacts and rest (still.py)."""
    raise NotImplementedError


def filter_block(
    state: ErkfState, inputs: ErkfInputs, tree: ImuTree, params: ErkfParams
) -> tuple[ErkfTrack, ErkfState]:
    """Advance over a block of samples; any division into blocks gives the same bits."""
    raise NotImplementedError


# core/body/erkf_start.py: start_state(tree, inputs, params, rest: tuple[int, int] | None, q: Floats | None) -> ErkfState
# core/body/smoother.py:   smooth(state, inputs, tree, params, segment=200) -> tuple[ErkfTrack, ErkfState]
# core/body/erkf_run.py:   run_erkf(tree, inputs, params, rest=None, q=None, smoothed=True) -> ErkfResult
