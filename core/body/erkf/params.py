"""Assumptions of the ErKF: noise, measurement uncertainty and initial state; three parameter sets with
sources.

All are standard deviations. σ_a and σ_ω are per sample at the recording's rate (density · √rate, Potter 2021
Table 1), inflated for effects not modelled.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import radians
from typing import Final, Literal

import numpy as np

from sagittal.core.errors import ParameterError
from sagittal.core.message import Message

Integration = Literal["trapezoid", "euler"]
"""euler: Potter 2021 eq 8, the sample at the start of the step; it costs 0.6 to 0.9° at 100 Hz
(docs/science/erkf.md, "Prediction"). trapezoid: the mean of both ends."""

GATE: Final = 16.27
"""χ² of 3 degrees of freedom at 0.999."""

SOFT_TISSUE: Final[Mapping[str, float]] = {"thigh_l": 0.2, "thigh_r": 0.2}
"""σ_ω in rad/s of the sensors that move most on the bone (docs/science/erkf.md, "Parameters")."""


@dataclass(frozen=True)
class ErkfParams:
    """Parameters of `filter_block` and `smooth`; None disables a correction.

    Parameters
    ----------
    states : per IMU, 9 (position, velocity, orientation) or 15 (with both biases).
    acc_sd : m/s². gyr_sd : rad/s. gyr_sd_of : IMU → individual value. impact : fraction c of the
        sample-to-sample change of specific force that is added as uncertainty, σ_a² + (c |f_k − f_k−1|)²
        (docs/science/erkf.md, "Impacts").
    gyr_walk, acc_walk : random walk of the biases, rad/s/√s and m/s²/√s (15 states).
    zero_velocity_sd : m/s, of a foot that is still. roll_m : m, multiplied by |ω| the additional uncertainty
        at the quietest moment of a rolling foot: half of the 0.1 m between a sensor on the instep and the
        ball, consistent with velocity over |ω| next to the still part of a stance in gaitmap_foot (0.03 to
        0.05 m forward, up to 0.1 m upward). gate : largest χ² of a zero velocity. reaccept_s : contact
        rejected for this long is accepted after all; `reaccept_m` is then added to the uncertainty of the
        foot (docs/science/erkf.md, "Zero velocity").
    tilt_sd : of the direction of f. joint_centre_sd : m. joint_axis_sd : rad.
    gap_acc_sd, gap_gyr_sd : in place of acc_sd and gyr_sd while an IMU is lost.
    patch_s : longer linearly interpolated gaps between two samples are patches. patch_acc_sd, patch_gyr_sd :
        added to acc_sd and gyr_sd in them (docs/science/erkf.md, "Lost packets").
    start_* : of the first sample; `start_heading_sd` about the vertical must cover the initial heading
        errors.
    moving_* : the same for a recording that starts mid-walk; the bias applies if it has no rest at all and
        corresponds to the accuracy of estimating it from walking (docs/science/erkf.md, "Start").
    """

    states: Literal[9, 15] = 15
    integration: Integration = "trapezoid"
    acc_sd: float = 0.1
    gyr_sd: float = 0.005
    gyr_sd_of: Mapping[str, float] = field(default_factory=lambda: SOFT_TISSUE)
    impact: float = 0.3
    gyr_walk: float = 5e-5
    acc_walk: float = 2e-4
    zero_velocity_sd: float = 0.01
    roll_m: float = 0.05
    gate: float | None = GATE
    reaccept_s: float = 0.08
    reaccept_m: float = 0.1
    tilt_sd: float | None = 0.1
    joint_centre_sd: float | None = 0.01
    joint_axis_sd: float | None = None
    gap_acc_sd: float = 20.0
    gap_gyr_sd: float = 5.0
    patch_s: float = 0.025
    patch_acc_sd: float = 10.0
    patch_gyr_sd: float = 1.0
    start_position_sd: float = 0.02
    start_velocity_sd: float = 0.01
    start_tilt_sd: float = radians(1.0)
    start_heading_sd: float = radians(30.0)
    start_gyr_bias_sd: float = radians(0.05)
    start_acc_bias_sd: float = 0.03
    moving_velocity_sd: float = 2.0
    moving_tilt_sd: float = radians(15.0)
    moving_gyr_bias_sd: float = radians(0.2)

    def __post_init__(self) -> None:
        if self.states not in (9, 15):
            raise ParameterError(
                "states_unknown", Message("{states} states per IMU, expected 9 or 15.", states=self.states)
            )
        if self.integration not in ("trapezoid", "euler"):
            raise ParameterError(
                "integration_unknown",
                Message(
                    "integration is '{integration}', expected trapezoid or euler.",
                    integration=self.integration,
                ),
            )
        for name, value in (*vars(self).items(), *self.gyr_sd_of.items()):
            if isinstance(value, float) and not (np.isfinite(value) and value >= 0.0):
                raise ParameterError(
                    "deviation_range",
                    Message("{name} = {value:g} is not 0 or above.", name=name, value=value),
                )
        for name in ("zero_velocity_sd", "tilt_sd", "joint_centre_sd", "joint_axis_sd"):
            if getattr(self, name) == 0.0:
                raise ParameterError(
                    "deviation_range", Message("{name} is 0; the filter needs it above 0.", name=name)
                )

    @classmethod
    def offline(cls) -> ErkfParams:
        """For stored recordings, with the smoother: 15 states (docs/science/erkf.md, "Parameters")."""
        return cls()

    @classmethod
    def people(cls) -> ErkfParams:
        """`offline` for sensors on skin: joint centres known to 1.5 cm, with the same error in every step
        (docs/science/erkf.md, "Joints err alike").
        """
        return cls(joint_centre_sd=0.045)

    @classmethod
    def live(cls) -> ErkfParams:
        """For streams: 9 states, gyroscope biases fixed from rest (same section)."""
        return cls(states=9, gyr_sd=0.02)

    @classmethod
    def paper(cls) -> ErkfParams:
        """Potter 2021 Table 1 at 512 Hz, σ_JA = 0.02 rad as required by its Table 2 (docs/science/erkf.md,
        "Departures from the paper").
        """
        return cls(
            states=9,
            integration="euler",
            acc_sd=0.027,
            gyr_sd=radians(5.66),
            gyr_sd_of={},
            impact=0.0,
            gate=None,
            joint_axis_sd=0.02,
            start_heading_sd=radians(1.0),
        )
