"""Correction of factors and axes of a sensor whose file is wrong.

A correction is part of the declarations on a recording (docs/reference/formats.md, "The manifest"); the files
are never modified.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import degrees, isclose, radians
from typing import Final

import numpy as np

from sagittal.core.errors import ParameterError
from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.message import Message

AXES: Final = ("x", "y", "z")
AS_READ: Final[tuple[str, ...]] = AXES
AGAINST: Final = ("-x", "-y", "-z")
"""All signs turned round."""

UNIT_FACTORS: Final[Mapping[str, Mapping[str, float]]] = {
    "acceleration": {
        "multiples of g": GRAVITY,
        "thousandths of g": 1e-3 * GRAVITY,
        "already in m/s²": 1.0 / GRAVITY,
    },
    "rates": {"degrees per second": radians(1.0), "already in rad/s": degrees(1.0)},
}
"""What values as read are taken for, and the factor that says so."""


@dataclass(frozen=True)
class SensorCorrection:
    """Axes and factors of one sensor.

    Parameters
    ----------
    acc_axes, gyr_axes : for each of the correct x, y and z the corresponding axis as read, such as ("-y",
        "x", "z"). acc_times, gyr_times : factors, such as 9.80665 if g was read as m/s².

    Raises
    ------
    ParameterError `correction_implausible`.
    """

    acc_axes: tuple[str, ...] = AS_READ
    gyr_axes: tuple[str, ...] = AS_READ
    acc_times: float = 1.0
    gyr_times: float = 1.0

    def __post_init__(self) -> None:
        for name in ("acc_axes", "gyr_axes"):
            axes = getattr(self, name)
            if sorted(a.removeprefix("-") for a in axes) != list(AXES):
                raise ParameterError(
                    "correction_implausible",
                    Message(
                        '{name} is {axes}; expected x, y and z once each, with or without a minus: ["-y", '
                        '"x", "z"].',
                        name=name,
                        axes=list(axes),
                    ),
                )
        for name in ("acc_times", "gyr_times"):
            if not 1e-4 <= getattr(self, name) <= 1e4:
                raise ParameterError(
                    "correction_implausible",
                    Message(
                        "{name} is {self:g}; expected a factor from 0.0001 to 10000.",
                        name=name,
                        self=getattr(self, name),
                    ),
                )

    @property
    def turns_axes(self) -> bool:
        """Whether it changes more than units."""
        return self.acc_axes != AS_READ or self.gyr_axes != AS_READ

    def correct_acc(self, acc: Floats) -> Floats:
        """Specific force (n, 3) in m/s² in the correct axes."""
        return acc @ (self.acc_times * to_axes_matrix(self.acc_axes)).T

    def correct_gyr(self, gyr: Floats) -> Floats:
        """Angular rate (n, 3) in rad/s in the correct axes."""
        return gyr @ (self.gyr_times * to_axes_matrix(self.gyr_axes)).T

    def follow(self, first: SensorCorrection) -> SensorCorrection:
        """The composition: first `first`, then this correction."""
        acc = to_axes_matrix(self.acc_axes) @ to_axes_matrix(first.acc_axes)
        gyr = to_axes_matrix(self.gyr_axes) @ to_axes_matrix(first.gyr_axes)
        return SensorCorrection(
            name_axes(acc),
            name_axes(gyr),
            self.acc_times * first.acc_times,
            self.gyr_times * first.gyr_times,
        )

    def to_json(self) -> dict[str, object]:
        """In the form of a manifest; unchanged items are omitted."""
        items: dict[str, object] = {
            name: list(getattr(self, name))
            for name in ("acc_axes", "gyr_axes")
            if getattr(self, name) != AS_READ
        }
        return items | {
            name: getattr(self, name) for name in ("acc_times", "gyr_times") if getattr(self, name) != 1.0
        }

    def say(self) -> str:
        """Description in words, "nothing" without any change.

        >>> SensorCorrection(gyr_times=0.017453292519943295).say()
        'its rates are taken as degrees per second'
        """
        phrases = []
        for whose, times, axes in (
            ("acceleration", self.acc_times, self.acc_axes),
            ("rates", self.gyr_times, self.gyr_axes),
        ):
            be = "is" if whose == "acceleration" else "are"
            unit = next((u for u, x in UNIT_FACTORS[whose].items() if isclose(x, times, rel_tol=1e-3)), None)
            if unit is not None:
                phrases.append(f"its {whose} {be} taken as {unit}")
            elif times != 1.0:
                phrases.append(f"its {whose} {be} multiplied by {times:.4g}")
            if axes == AGAINST:
                phrases.append(f"its {whose} {be} taken with all signs turned round")
            elif axes != AS_READ:
                named = ", ".join(axes).replace("-", "\N{MINUS SIGN}")
                phrases.append(f"the axes of its {whose} are taken as {named} for x, y, z")
        return " and ".join(phrases) or "nothing"


def to_axes_matrix(axes: Sequence[str]) -> Floats:
    """Matrix (3, 3) from values as read to the named axes.

    >>> to_axes_matrix(("-y", "x", "z"))[0].tolist()
    [0.0, -1.0, 0.0]
    """
    matrix = np.zeros((3, 3))
    for row, name in enumerate(axes):
        matrix[row, AXES.index(name.removeprefix("-"))] = -1.0 if name.startswith("-") else 1.0
    return matrix


def name_axes(matrix: Floats) -> tuple[str, ...]:
    """The axis names of a signed permutation (3, 3): the inverse of `to_axes_matrix`."""
    columns = np.argmax(np.abs(matrix), axis=1)
    return tuple(("-" if matrix[row, c] < 0.0 else "") + AXES[c] for row, c in enumerate(columns))
