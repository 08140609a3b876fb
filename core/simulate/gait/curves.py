"""Target curves of healthy gait over the gait cycle of the same side, as Fourier series.

Pelvis and hip adduction are fits of the WBDS adult means (Fukuchi 2018, n = 42; rotation and obliquity made
antisymmetric, tilt symmetric between the sides). Hip, knee, ankle and foot pitch are WBDS fits plus
corrections fitted once, so that the *resulting* curves match the WBDS means at step 0.64 m, 0.54 s: they are
inputs, not the resulting curves (docs/science/simulation.md, "Target curves").
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sagittal.core.frames import Floats


@dataclass(frozen=True)
class Curve:
    """A periodic curve of gait phase.

    Parameters
    ----------
    coefficients_deg : a0, cos 1, sin 1, cos 2, sin 2, … in degrees.
    """

    coefficients_deg: tuple[float, ...]

    @property
    def mean(self) -> float:
        """Mean over the cycle, rad."""
        return float(np.radians(self.coefficients_deg[0]))

    def __call__(self, phase: Floats) -> Floats:
        """Value in rad at `phase` (n,) in cycles, 0 = own initial contact."""
        c = np.radians(np.asarray(self.coefficients_deg))
        # powers of one complex exponential: a dozen harmonics for the price of one sine
        harmonics = (c[1::2] - 1j * c[2::2])[::-1]
        z = np.exp(2j * np.pi * np.asarray(phase, np.float64))
        total = np.zeros_like(z)
        for h in harmonics:
            total = (total + h) * z
        return np.asarray(c[0] + total.real)


# fmt: off
PELVIS_TILT = Curve((9.8219, -0.001, 0.0, 0.5358, -0.2866, -0.001, 0.0, 0.0833, -0.1094))
"""Anterior positive; phase of the right side."""

PELVIS_OBLIQUITY = Curve(
    (0.0, 1.3787, 2.4991, 0.0001, 0.0, -1.4494, 0.5429, 0.0001, 0.0, -0.2147, -0.0986, 0.0001, 0.0, 0.0275,
     0.0032)
)
"""Right side up positive; phase of the right side."""

PELVIS_ROTATION = Curve(
    (-0.0008, 5.2871, 2.1192, -0.0015, 0.0, 0.1702, -0.4535, -0.0015, 0.0, 0.3347, 0.0675)
)
"""Right side forward positive; phase of the right side."""

HIP_ADDUCTION = Curve(
    (0.7648, 0.6578, 4.7792, -0.2393, -0.6317, -1.5684, 0.602, 0.0659, 0.0566, -0.2116, -0.1758,
     -0.0575, -0.0096, 0.0795, 0.005, 0.0054, 0.0037)
)

HIP_FLEXION = Curve(
    (14.6042, 22.1969, -6.1832, -2.1564, -4.0213, -0.9621, 0.5283, -0.3365, -0.0469, 0.0316, 0.1709,
     0.0827, -0.1243, -0.0718, -0.1484, 0.0636, -0.0654, 0.0497, -0.0264, 0.0035, -0.0298)
)

KNEE_FLEXION = Curve(
    (19.2775, -1.5553, -22.0045, -13.2083, 7.7028, -0.3687, 4.4782, 0.7555, 0.1848, -0.317, -0.0222,
     0.5638, -0.1469, 0.2137, -0.0051, -0.1029, 0.2428, 0.3188, -0.0643, 0.0359, 0.1741, 0.053,
     -0.043, 0.0221, -0.0221)
)

ANKLE_DORSIFLEXION = Curve(
    (0.7347, -4.1517, 6.6068, -0.6403, -4.8145, -3.8455, 2.0239, 1.6126, -0.0272, -0.8371, -0.9197,
     0.1478, 0.4925, 0.3109, -0.4084, 0.0633, -0.0288, 0.2777, -0.1894, 0.0421, -0.1459, 0.1284,
     -0.0113, 0.1167, -0.0445, -0.0037, -0.0094, -0.0097, -0.0053)
)

FOOT_PITCH = Curve(
    (-12.9231, 20.9759, 20.7469, 9.698, -15.098, -2.7598, -2.5014, 1.1912, -1.3965, 0.2258, -1.539,
     -0.1787, -0.328, 0.6894, -0.6454, -0.4572, -0.3487, 0.5059, 0.0703, -0.0851, -0.495, 0.0411,
     0.1827, 0.1305, -0.2157, -0.0528, 0.0789, 0.0259, -0.0672)
)
"""Toes up positive, 0 = flat."""
