"""Leg angles cut into repetitions; in numpy, for readers of finished analyses too."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from sagittal.core.angles import JointAngles
from sagittal.core.frames import SUFFIX, Floats, Side
from sagittal.core.parameters.resample import resample

KNEE: Final = "knee_flexion"
INWARD: Final = ("hip_adduction", "hip_rotation")
VALGUS: Final = "knee_valgus"
"""The sum of `INWARD`, each from where the repetition begins."""

CURVES: Final = (KNEE, "hip_flexion", *INWARD, "ankle_dorsiflexion", "ankle_inversion", "ankle_rotation")
"""Angles of the leg whose courses over a repetition are kept."""


def cut_curves(angles: JointAngles, side: Side, bounds: Sequence[tuple[float, float]]) -> dict[str, Floats]:
    """`CURVES` and `VALGUS` → (m, 101) rad over m repetitions, for the angles available.

    Parameters
    ----------
    bounds : start and end of every repetition, s.
    """
    own = {name: angles.angles.get(f"{name}_{SUFFIX[side]}") for name in CURVES}
    available = {name: values for name, values in own.items() if values is not None}
    if not available or not bounds:
        return {}
    rows = resample(available.values(), angles.t_s, np.array(bounds))
    curves = dict(zip(available, rows, strict=True))
    if all(name in curves for name in INWARD):
        curves[VALGUS] = np.add(*(curves[name] - curves[name][:, :1] for name in INWARD))
    return curves
