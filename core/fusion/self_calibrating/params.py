"""Expected properties of a sensor and its environment; numbers that only shape the computation."""

from __future__ import annotations

from dataclasses import astuple, dataclass
from math import isfinite
from typing import Final, NamedTuple

from sagittal.core.errors import ParameterError
from sagittal.core.frames import GRAVITY
from sagittal.core.message import Message


@dataclass(frozen=True)
class SelfCalibratingParams:
    """The parameters that affect the result; docs/science/self-calibrating-filter.md, "Parameters".

    Parameters
    ----------
    velocity_gain : standard deviation of the velocity, in multiples of the measured speed of the motion.
    gyro_noise : rad/√s. gyro_rate_noise : √s, orientation noise per angular rate, not described by the
        gyroscope matrix. gyro_matrix_sd : of scale and misalignment.
    gyro_bias_sd : rad/s at the start. gyro_bias_walk : rad/s/√s. acc_bias_sd : m/s².
    field_sd : local magnetic field minus that of its region, and field of the region minus that at the start,
        relative to the field norm. field_length_m : distance over which the local field changes.
        hard_iron_sd : relative to the field norm.
    mag_delay_s, mag_delay_sd_s : prior delay of the magnetometer and its uncertainty; the delay is estimated.
    """

    velocity_gain: float = 1.0
    gyro_noise: float = 3.5e-4
    gyro_rate_noise: float = 0.002
    gyro_matrix_sd: float = 0.002
    gyro_bias_sd: float = 8.7e-3
    gyro_bias_walk: float = 3.5e-5
    acc_bias_sd: float = 0.01
    field_sd: float = 0.05
    field_length_m: float = 0.2
    hard_iron_sd: float = 0.005
    mag_delay_s: float = 0.0
    mag_delay_sd_s: float = 0.015

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            least = -0.02 if name == "mag_delay_s" else 0.0
            if not isfinite(value) or value < least or (value == 0.0 and name == "field_length_m"):
                raise ParameterError(
                    "parameter_out_of_range",
                    Message(
                        "{name} = {value:g}; expected a number of {least:g} or more.",
                        name=name,
                        value=value,
                        least=least,
                    ),
                )


class KernelWeights(NamedTuple):
    """The parameters in the order of `SelfCalibratingParams`, for the compiled loops."""

    velocity_gain: float
    gyro_noise: float
    gyro_rate_noise: float
    gyro_matrix_sd: float
    gyro_bias_sd: float
    gyro_bias_walk: float
    acc_bias_sd: float
    field_sd: float
    field_length_m: float
    hard_iron_sd: float
    mag_delay_s: float
    mag_delay_sd_s: float


def make_weights(params: SelfCalibratingParams) -> KernelWeights:
    """The parameters as a tuple for the compiled loops."""
    return KernelWeights(*(float(x) for x in astuple(params)))


# Halving or doubling one of those below moves the mean error on the eight BROAD trials by at most 0.05° in
# total and 0.01° in inclination, of REGION_ACROSS_SD by 0.3° live ("Parameters" of the page above); all are
# our choice.

INTERVAL_S: Final = 0.1
"""Time between corrections; the gyroscope is integrated sample by sample."""

VELOCITY_TIME_S: Final = 1.0
"""Correlation time of the velocity, the time constant of what counts as motion, both s."""
MOTION_TIME_S: Final = 1.0
INTENSITY_TIME_S: Final = 1.5
"""Over which the speed of the motion is averaged."""
SLOW_SHARE: Final = 5.0
"""Squared speed over that of its slow part, for a velocity that is new after `VELOCITY_TIME_S`."""
LEAST_SPEED: Final = 0.01
"""m/s."""

SHAKEN_BIAS_SD: Final = 5.2e-4
"""rad/s per g² of shaking: the gyroscope's bias is another one in vibration."""

REST_NOISE: Final = 5.2e-4
"""rad/s of a gyroscope's mean over 1 s of rest."""
REST_AFTER_S: Final = 1.5
REST_MEAN_S: Final = 0.5
REST_RATE: Final = 0.035
"""rad/s from its own mean over `REST_MEAN_S`, and of that mean."""
REST_FORCE: Final = 0.5
"""m/s² from its own mean."""

ACC_NOISE: Final = 0.002
"""m/s/√s."""
ACC_SHOCK_NOISE: Final = 0.01
"""√s, more of it per m/s² of motion: shocks."""
ACC_DELAY_SD_S: Final = 0.001
"""Accelerometer against gyroscope."""
GRAVITY_MPS2: Final = GRAVITY
GRAVITY_SD: Final = 0.03
"""m/s²; the scale of the accelerometer is in it."""

REGION_ACROSS_SD: Final = 0.008
"""How far the field of a region points to the east or west of that of the start, in norms of the field; along
and upright it is `field_sd`."""
FIELD_RATE: Final = 0.001
"""1/s at which the field changes while nothing moves."""
PLACE_S: Final = 1.0
"""The field of a rest is averaged over this, and is of the start's place where its level and its upright part
are those of the start within `PLACE_ALIKE`; the heading is as sure then as `PLACE_SD`, all in norms."""
PLACE_ALIKE: Final = 0.01
PLACE_SD: Final = 0.005
MAG_NOISE: Final = 0.0063
"""√s, in norms of the field; per rad/s more: `MAG_RATE_NOISE`."""
MAG_RATE_NOISE: Final = 0.0016
JUMP_SQUARE: Final = 16.0
"""A magnet came or went where the field is off by so many variances for `JUMP_S`."""
JUMP_S: Final = 0.2
JUMP_PAUSE_S: Final = 1.0
JUMP_IRON: Final = 0.3
JUMP_FIELD: Final = 0.1

START_S: Final = 0.35
START_MOVING_S: Final = 3.0
"""The first orientation is a mean over these, at rest and in motion."""
START_TILT: Final = 0.05
"""rad, and so many times it and all that follows when moving: `START_MOVING`."""
START_MOVING: Final = 4.0
START_HEADING: Final = 0.0087
"""rad: a field that is read in motion is north, by definition."""
LEAST_FIELD: Final = 1e-4
"""Norms of the field that it is another by while nothing moved."""
LEAST_FLAT: Final = 0.05
"""Level field, in norms, below which a heading from it is known no less."""
START_SPEED: Final = 0.3
MOVING_RATE: Final = 0.2
MOVING_FORCE: Final = 0.5
"""rad/s, m/s² from the first sample: above, the start is in motion."""

LOST_TURN: Final = 2.0
"""rad²/s: how little is known of the orientation while samples are missing; of the velocity, m²/s³:
`LOST_PUSH`."""
LOST_PUSH: Final = 10.0
