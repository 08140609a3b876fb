"""Target angles of one leg: the healthy curves with the deviations of this side (docs/science/simulation.md,
"Target curves").

Centres and widths of the bumps are phases of the leg's own cycle, 0 = initial contact.
"""

from __future__ import annotations

from math import radians
from typing import Final

import numpy as np

from sagittal.core.frames import Floats
from sagittal.core.simulate.gait.curves import ANKLE_DORSIFLEXION, HIP_ADDUCTION, HIP_FLEXION, KNEE_FLEXION
from sagittal.core.simulate.shapes import phase_bump
from sagittal.core.simulate.walker import SideGait

DEGREE: Final = radians(1.0)

HIP_MIDDLE: Final = 12.0 * DEGREE
"""Hip flexion about which a smaller range shrinks."""

LOADING_WAVE: Final = 12.0 * DEGREE
"""Knee flexion after contact that `knee_wave` takes a share of."""

_HEALTHY_SWING: Final = float(KNEE_FLEXION(np.array([0.72]))[0])
"""The knee command at its peak in swing, rad."""


def knee_flexion(gait: SideGait, phase: Floats) -> Floats:
    """Knee target (n,) in rad at phase (n,)."""
    knee = KNEE_FLEXION(phase)
    if gait.knee_swing_rad is None and gait.knee_stance_rad == 0.0 and gait.knee_wave == 1.0:
        return knee
    swing = phase_bump(phase, 0.70, 0.36)
    if gait.knee_swing_rad is not None:
        knee = knee + (gait.knee_swing_rad - _HEALTHY_SWING) * swing
    wave = (gait.knee_wave - 1.0) * LOADING_WAVE * phase_bump(phase, 0.13, 0.15)
    return np.asarray(knee + gait.knee_stance_rad * (1.0 - swing) + wave)


def hip_flexion(gait: SideGait, phase: Floats) -> Floats:
    """Hip target (n,) in rad."""
    centred = gait.hip_factor * (HIP_FLEXION(phase) - HIP_MIDDLE) + HIP_MIDDLE
    flexion = HIP_FLEXION(phase) if gait.hip_factor == 1.0 else centred
    return np.asarray(flexion + gait.hip_swing_rad * phase_bump(phase, 0.82, 0.30))


def hip_adduction(gait: SideGait, phase: Floats) -> Floats:
    """Hip adduction target (n,) in rad."""
    return np.asarray(HIP_ADDUCTION(phase) - gait.circumduction_rad * phase_bump(phase, 0.80, 0.24))


def ankle_dorsiflexion(gait: SideGait, phase: Floats) -> Floats:
    """Ankle target (n,) in rad."""
    added = gait.ankle_swing_rad * phase_bump(phase, 0.85, 0.34)
    return np.asarray(gait.ankle_factor * ANKLE_DORSIFLEXION(phase) + added)
