"""The magnetic field in a room: that of the Earth and of ferromagnetic objects, which decays with the cube of
distance.

Steel furniture, reinforced floors and lifts distort the field locally; iron at the sensor itself rotates with
it (hard iron, core/simulate/mems.py). Fields are in units of the Earth's field, as in Xsens data.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin
from typing import Final

import numpy as np

from sagittal.core.errors import ParameterError
from sagittal.core.frames import Floats

FIELD_DIP: Final = radians(65.0)
"""Inclination of the Earth's field below the horizon in central Europe."""

IRON_SIZE_M: Final = 0.1
"""A thing is not a point: nearer than this its field does not grow any more."""


@dataclass(frozen=True)
class Dipole:
    """A magnetised object.

    Parameters
    ----------
    position_m : (x, y, z) in the world, the floor at z = 0.
    moment : (x, y, z) the field at 1 m on the axis is twice the moment, in Earth's fields · m³.
    """

    position_m: tuple[float, float, float]
    moment: tuple[float, float, float]

    def __post_init__(self) -> None:
        if not np.isfinite((*self.position_m, *self.moment)).all():
            raise ParameterError(
                "dipole_not_finite", f"Position {self.position_m} and moment {self.moment} must be finite."
            )


def earth_field(north_rad: float) -> Floats:
    """The undisturbed field (3,), of length 1; `north_rad` is the heading of magnetic north in the world."""
    return np.array([cos(FIELD_DIP) * cos(north_rad), cos(FIELD_DIP) * sin(north_rad), -sin(FIELD_DIP)])


def field_at(p: Floats, north_rad: float, dipoles: tuple[Dipole, ...]) -> Floats:
    """The field in the world at positions p (n, 3) in m: (3 (m·r) r / r² − m) / r³ per dipole; (n, 3)."""
    field = np.tile(earth_field(north_rad), (len(p), 1))
    for dipole in dipoles:
        moment = np.array(dipole.moment)
        offset = p - dipole.position_m
        distance = np.linalg.norm(offset, axis=1, keepdims=True)
        unit = offset / np.maximum(distance, 1e-9)
        near = np.maximum(distance, IRON_SIZE_M)
        field += (3.0 * (unit @ moment)[:, None] * unit - moment) / near**3
    return field
