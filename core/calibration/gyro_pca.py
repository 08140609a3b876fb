"""The flexion axis as principal axis of the angular rate, and the sign rules of gait.

Nazarahari 2021 (thesis), ch. 3, with the corrections of docs/science/calibration.md, "Flexion axis by gyro
PCA": rows instead of columns in Eq 14, a different seed axis if the sensor's x is vertical, γ = atan2(−p_x,
p_z) instead of Eq 15.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

import numpy as np
from numpy.typing import NDArray

from sagittal.core.errors import CalibrationError
from sagittal.core.frames import Bools, Floats, Segment
from sagittal.core.message import Message
from sagittal.core.rotation import find_vertical
from sagittal.core.signals.held_samples import cut_blocks

SINGLE_AXIS, GOOD_AXIS = 0.70, 0.85
"""Share of the first component: below the first an error, below the second a notice
(docs/science/calibration.md, "Parameters")."""

WEAK_MARGIN = radians(5.0)
"""Difference of the two sides of the sagittal angle below which its sign is weak
(docs/science/calibration.md, "Signs")."""


@dataclass(frozen=True, eq=False)
class FlexionAxis:
    """Rotation axis of a segment with undetermined sign.

    Parameters
    ----------
    gamma : rad, R_y(γ) R_vertical has z parallel or antiparallel to the axis. rho : explained share of the
    first component.
    """

    gamma: float
    rho: float


@dataclass(frozen=True)
class MainAxis:
    """First principal axis (x, z) of horizontal rates, with arbitrary sign, and its share of the variance."""

    x: float
    z: float
    share: float


def measure_main_axis(horizontal: Floats) -> MainAxis:
    """Principal axis of rates (n, 2) about x and z, rad/s."""
    W = horizontal - horizontal.mean(axis=0)
    values, vectors = np.linalg.eigh(W.T @ W)
    px, pz = vectors[:, 1]
    return MainAxis(float(px), float(pz), float(values[1] / max(values.sum(), 1e-12)))


def flexion_axis(rate: Floats, R_vertical: Floats, segment: Segment) -> FlexionAxis:
    """Rotation of the vertical frame about its y axis that aligns z with the rotation axis of the segment.

    Parameters
    ----------
    rate : (n, 3) bias-free angular rate in sensor coordinates while moving. R_vertical : (3, 3), rows.

    Raises
    ------
    CalibrationError `not_single_axis` if the movement has no dominant axis (ρ < 0.70).
    """
    axis = measure_flexion(rate, R_vertical)
    rho = axis.rho
    if rho < SINGLE_AXIS:
        raise CalibrationError(
            "not_single_axis",
            Message(
                "{segment}: the movement has no dominant axis: the first principal component explains "
                "{rho:.0%} of it, at least {SINGLE_AXIS:.0%} is required. Walk straight for at least 8 "
                "steps, or calibrate from the walking direction.",
                segment=segment,
                rho=rho,
                SINGLE_AXIS=SINGLE_AXIS,
            ),
            sensor=segment,
        )
    return axis


def measure_flexion(rate: Floats, R_vertical: Floats) -> FlexionAxis:
    """Like `flexion_axis`, for rates (n, 3) in sensor coordinates, without a check for a dominant axis."""
    axis = measure_main_axis((rate @ R_vertical.T)[:, [0, 2]])
    return FlexionAxis(float(np.arctan2(-axis.x, axis.z)), axis.share)


def about_vertical(gamma: float) -> Floats:
    """Matrix R_y(γ): R_y(γ) p = +z for γ = atan2(−p_x, p_z) (thesis Eq 15, corrected)."""
    c, s = np.cos(gamma), np.sin(gamma)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def sagittal_angle(up: Floats, R_segment_sensor: Floats) -> Floats:
    """Sagittal inclination (n,) in rad, distal end forward positive, from the vertical (n, 3) in sensor axes.

    From inclination, not from an integrated rate: 6 of 6 signs right (docs/science/calibration.md, "Signs").
    """
    v = up @ R_segment_sensor.T
    return np.asarray(np.arctan2(v[:, 0], v[:, 1]))


def sagittal_course(q: Floats, R_segment_sensor: Floats) -> Floats:
    """Sagittal inclination (n,) from orientations (n, 4) of the sensor in a world frame with z up."""
    angle = np.empty(len(q))
    for part in cut_blocks(len(q)):
        angle[part] = sagittal_angle(find_vertical(q[part]), R_segment_sensor)
    return angle


def gait_margin(angle: Floats, walking: Bools, segment: Segment) -> float:
    """Margin by which the sagittal angle has the correct sign, rad; negative: the wrong sign.

    In walking, heel rise tips foot and shank further backward than they ever tip forward, and the thigh
    swings further forward than backward (docs/science/calibration.md, "Signs"; percentiles 2 and 98).
    """
    low, high = np.percentile(angle[walking], [2.0, 98.0])
    margin = abs(high) - abs(low) if segment.startswith("thigh") else abs(low) - abs(high)
    return float(margin)


def count_steps(angle: Floats, walking: Bools) -> int:
    """Number of steps in a walk (n,) from the sagittal angle (n,) of a leg sensor: two for each rise from
    its lower into its upper third.
    """
    return 2 * int(np.count_nonzero(np.diff(_tell_thirds(angle[walking])) > 0))


def count_repetitions(angle: Floats) -> int:
    """Number of times an angle (n,) enters its upper third after visiting the lower one, starting from any
    position.
    """
    state = _tell_thirds(angle)
    return int(np.count_nonzero(np.diff(state) > 0)) + int(len(state) > 0 and state[0] > 0)


def _tell_thirds(x: Floats) -> NDArray[np.int64]:
    """Samples of x (n,) in its upper third (1) or lower third (−1); samples in between are dropped."""
    low, high = np.percentile(x, [2.0, 98.0])
    state = np.where(x > high - (high - low) / 3, 1, np.where(x < low + (high - low) / 3, -1, 0))
    return np.asarray(state[state != 0])
