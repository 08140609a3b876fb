"""Sensors of people who stand still, aligned with their segments: what live estimators begin with."""

from __future__ import annotations

from typing import Final

import numpy as np

from sagittal.core.body import BodyModel
from sagittal.core.body.live_estimator import MeasuredBlock
from sagittal.core.frames import GRAVITY, R_NEUTRAL, Floats, Segment
from sagittal.core.rotation import from_matrix
from sagittal.core.signals.calibrated import SegmentCalibration

RATE: Final = 100.0
BODY: Final = BodyModel.from_height(1.7)
NEUTRAL: Final[Floats] = from_matrix(R_NEUTRAL)
BIAS: Final = np.array([0.01, -0.02, 0.03])
EXCESS: Final = 0.2
"""What the norm at rest is over gravity, m/s²."""


def mounted(*segments: Segment) -> dict[Segment, SegmentCalibration]:
    return {s: SegmentCalibration(np.eye(3), BIAS, GRAVITY + EXCESS, "declared", 1.0) for s in segments}


def stand(samples: int, *segments: Segment) -> MeasuredBlock:
    """What aligned sensors measure: up is y of every segment."""
    shape = samples, len(segments)
    return MeasuredBlock(
        np.tile([0.0, GRAVITY + EXCESS, 0.0], (*shape, 1)),
        np.tile(BIAS, (*shape, 1)),
        np.ones(shape, np.bool_),
        {s: np.tile(NEUTRAL, (samples, 1)) for s in segments},
        np.zeros(shape, np.bool_),
    )
