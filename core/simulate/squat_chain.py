"""Sensors of a simulated squat placed as in Kianifar et al., and the chain with exact parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import radians
from typing import Final

import numpy as np

from sagittal.core.body.chain.geometry import LegGeometry
from sagittal.core.calibration.fixed_offset import make_fixed_mounts
from sagittal.core.frames import SHANK, THIGH, Floats, Segment, Side
from sagittal.core.rotation import exp, from_matrix, to_matrix
from sagittal.core.simulate.sensors import Mount
from sagittal.core.simulate.walker import Walker

TURNED: Final = radians(10.0)
"""Largest turn of a sensor about each axis where a hand put it on."""


def measure_leg(height_m: float, side: Side) -> LegGeometry:
    """Body dimensions of the leg of a simulated person of a height; dimensions it does not define are
    nominal.

    Raises
    ------
    ParameterError : "height_implausible".
    """
    person, nominal = Walker.of_height(height_m).anatomy, LegGeometry.from_height(height_m, side)
    return LegGeometry(
        side=side,
        tibia=person.shank,
        thigh=person.thigh,
        pelvis_width=nominal.pelvis_width,
        leg_length=nominal.leg_length,
    )


def draw_leg(height_m: float, side: Side, seed: int = 0) -> tuple[LegGeometry, dict[Segment, Floats]]:
    """The leg, with manually attached sensors: displaced by up to 1 cm and rotated by up to 10°, both known.

    Returns
    -------
    Its geometry, and segment → (3, 3) R_segment_sensor.
    """
    rng = np.random.default_rng(seed)
    aside = rng.uniform(-0.01, 0.01, 2)
    leg = replace(measure_leg(height_m, side), tibia_aside=float(aside[0]), thigh_aside=float(aside[1]))
    turns = rng.uniform(-TURNED, TURNED, (3, 3))
    mounts = make_fixed_mounts(side)
    return leg, {s: to_matrix(exp(turn)) @ mounts[s] for s, turn in zip(mounts, turns, strict=True)}


def place_as_agreed(height_m: float, sides: Sequence[Side]) -> dict[Segment, Mount]:
    """Sensors on the legs of these sides as specified by the protocol, and one on the middle of the back."""
    legs = [place_sensors(measure_leg(height_m, side), height_m) for side in sides]
    back = np.mean([leg["pelvis"].position_m for leg in legs], axis=0)
    placed = {segment: mount for leg in legs for segment, mount in leg.items()}
    return placed | {"pelvis": replace(placed["pelvis"], position_m=back)}


def place_sensors(
    leg: LegGeometry, height_m: float, turned: Mapping[Segment, Floats] | None = None
) -> dict[Segment, Mount]:
    """Sensors on shin, thigh and back of a person of a height.

    Parameters
    ----------
    leg : defines positions. turned : segment → (3, 3) R_segment_sensor, else as in `make_fixed_mounts`.
    """
    hips = Walker.of_height(height_m).anatomy.hip_width
    hip = np.array([0.0, 0.0, 0.5 * leg.outward * hips])
    places: dict[Segment, Floats] = {
        SHANK[leg.side]: leg.tibia_sensor_from_ankle() - leg.knee_from_ankle(),
        THIGH[leg.side]: leg.thigh_sensor_from_knee() - leg.hip_from_knee(),
        "pelvis": leg.back_sensor_from_hip() + hip,
    }
    mounts = {**make_fixed_mounts(leg.side), **(turned or {})}
    return {s: Mount(place, from_matrix(mounts[s])) for s, place in places.items()}
