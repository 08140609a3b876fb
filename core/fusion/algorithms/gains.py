"""Adaptive gains: fixed, switched between two or three levels, or by fuzzy rules.

Nazarahari 2021, eq 23, 48–50 and section 4.2.2. A deviation is |‖y‖ − ‖y at rest‖| relative to the norm at
rest for accelerometer and magnetometer, and ‖y‖ in rad/s for the gyroscope.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, nan
from typing import Final

import numpy as np

from sagittal.core.errors import ParameterError
from sagittal.core.frames import Floats
from sagittal.core.message import Message

LEVELS: Final = slice(0, 3)
"""Where a row has the values of its levels."""
OUTPUT: Final = slice(34, 42)
"""Where a row has the corners of a fuzzy gain's own membership functions."""
WIDTH: Final = 42
"""Numbers of a row: levels (3), thresholds (6), rule (1), corners of accelerometer, magnetometer, gyroscope
and the gain (8 each)."""
FUZZY_FALLS, FUZZY_RISES = 1.0, 2.0

LONGEST_WINDOW: Final = 64
"""Samples of innovations that a filter keeps."""


@dataclass(frozen=True)
class FixedGain:
    """One value at all times."""

    value: float

    def __post_init__(self) -> None:
        _require_not_negative(self.value)

    def row(self) -> Floats:
        """Row (42,) for `choose_level`."""
        return _level_row((self.value, self.value, self.value), (inf, inf, inf), (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class TwoLevelGain:
    """`quiet` while every named deviation is below its threshold, else `moving`.

    Parameters
    ----------
    acc, mag : threshold in units of the norm at rest. gyr : rad/s. inf = not used.
    """

    quiet: float
    moving: float
    acc: float = inf
    mag: float = inf
    gyr: float = inf

    def __post_init__(self) -> None:
        _require_not_negative(self.quiet, self.moving, self.acc, self.mag, self.gyr)

    def row(self) -> Floats:
        """Row (42,) for `choose_level`."""
        limits = self.acc, self.mag, self.gyr
        return _level_row((self.quiet, self.moving, self.moving), limits, (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class ThreeLevelGain:
    """`quiet` below the first thresholds, `middle` below the second, else `moving`.

    Parameters
    ----------
    acc, mag : first and second threshold in units of the norm at rest. gyr : rad/s. inf = not used.
    """

    quiet: float
    middle: float
    moving: float
    acc: tuple[float, float] = (inf, inf)
    mag: tuple[float, float] = (inf, inf)
    gyr: tuple[float, float] = (inf, inf)

    def __post_init__(self) -> None:
        pairs = (self.acc, self.mag, self.gyr)
        _require_not_negative(self.quiet, self.middle, self.moving, *(x for pair in pairs for x in pair))
        if any(low > high for low, high in pairs):
            raise ParameterError("gain_out_of_range", "The first threshold of a gain is above its second.")

    def row(self) -> Floats:
        """Row (42,) for `choose_level`."""
        low, high = zip(self.acc, self.mag, self.gyr, strict=True)
        return _level_row((self.quiet, self.middle, self.moving), low, high)


Corners = tuple[float, float, float, float, float, float, float, float]
"""(L₁, L₂, M₁, M₂, M₃, M₄, H₁, H₂): low falls from L₁ to L₂, middle rises from M₁ to M₂ and falls from
M₃ to M₄, high rises from H₁ to H₂."""


@dataclass(frozen=True)
class FuzzyGain:
    """Mamdani's rules on low, middle and high deviations; the gain is the centroid of their output.

    Falling (a gain against the gyroscope): all low → high; any high → low; any middle and none high → middle.
    The thesis requires all middle, which leaves undefined cases (docs/science/filters.md, "Corrections to the
    texts"). Rising (a noise): low → low, middle → middle, high → high.

    Parameters
    ----------
    output : of the gain. acc, mag, gyr : of a deviation; None = not used. rising : which rules.
    """

    output: Corners
    acc: Corners | None = None
    mag: Corners | None = None
    gyr: Corners | None = None
    rising: bool = False

    def __post_init__(self) -> None:
        named = [c for c in (self.acc, self.mag, self.gyr) if c is not None]
        if not named:
            raise ParameterError("gain_out_of_range", "A fuzzy gain follows at least one sensor.")
        _require_not_negative(*(x for corners in (self.output, *named) for x in corners))

    def row(self) -> Floats:
        """Row (42,) for `choose_level`."""
        row = np.zeros(WIDTH)
        row[9] = FUZZY_RISES if self.rising else FUZZY_FALLS
        for i, corners in enumerate((self.acc, self.mag, self.gyr, self.output)):
            row[10 + 8 * i : 18 + 8 * i] = nan if corners is None else order_corners(corners)
        return row


Gain = FixedGain | TwoLevelGain | ThreeLevelGain | FuzzyGain


@dataclass(frozen=True)
class InnovationRules:
    """Adaptation of the process noise to the innovations (section 4.2.2.3): not a gain, but its change per
    sample.

    The discrepancy is the expected squared innovation, diagonal of P + R, minus its mean over the window. Low
    (more than expected) → high, an increase; middle → middle; high → low, a decrease.

    Parameters
    ----------
    discrepancy : corners, of the quaternion squared. change : corners, of σ_G² in (rad/s)² per sample at 100
        Hz. window : samples at 100 Hz.
    """

    discrepancy: Corners
    change: Corners
    window: int = 15

    def __post_init__(self) -> None:
        if not 1 <= self.window <= LONGEST_WINDOW:
            raise ParameterError(
                "gain_out_of_range",
                Message("The window is 1 to {LONGEST_WINDOW} samples.", LONGEST_WINDOW=LONGEST_WINDOW),
            )

    def row(self) -> Floats:
        """Row (42,) for `infer_gain`."""
        row = np.full(WIDTH, nan)
        row[9] = FUZZY_FALLS
        row[10:18] = order_corners(self.discrepancy)
        row[OUTPUT] = order_corners(self.change)
        return row


def order_corners(corners: Corners) -> Corners:
    """Corners shifted so that neighbours meet: the seven constraints of section 4.2.3, in order."""
    l1, l2, m1, m2, m3, m4, h1, h2 = corners
    l2 = max(l2, l1, m1)
    m2 = max(m2, m1)
    m3 = max(m3, m2)
    m4 = max(m4, m3, h1)
    return l1, l2, m1, m2, m3, m4, h1, max(h2, h1)


def _level_row(
    values: tuple[float, float, float], first: tuple[float, ...], second: tuple[float, ...]
) -> Floats:
    row = np.zeros(WIDTH)
    row[:9] = *values, *first, *second
    return row


def _require_not_negative(*values: float) -> None:
    if not all(value >= 0.0 for value in values):
        raise ParameterError("gain_out_of_range", "A gain or a threshold is negative or not a number.")
