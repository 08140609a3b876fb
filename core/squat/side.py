"""Which leg squats: the one that carries the sensors, or of two the one whose foot stands."""

from __future__ import annotations

from typing import Final

import numpy as np

from core.body.chain.model import leg_segments
from core.errors import EstimationError
from core.frames import FOOT, SIDES, Side
from core.recording import UniformRecording

STANDS: Final = 0.5
"""The standing foot turns at most so much of what the other does (our choice)."""


def find_squat_side(recording: UniformRecording) -> Side:
    """The leg that squats in a take.

    Raises
    ------
    EstimationError `segments_missing` where no leg has sensors on shank and thigh, or the pelvis none;
    `side_unknown` where both have and the feet do not tell.
    """
    worn = [side for side in SIDES if set(leg_segments(side)) <= set(recording.sensors)]
    if not worn:
        raise EstimationError(
            "segments_missing",
            "A squat on one leg needs sensors on the pelvis, and on shank and thigh of that leg; wear or map "
            "them.",
        )
    if len(worn) == 1:
        return worn[0]
    turned = {}
    for side in worn:
        sensor = recording.sensors.get(FOOT[side])
        if sensor is None or not sensor.valid.any():
            break
        gyr = sensor.gyr[sensor.valid]
        turned[side] = float(np.mean(np.linalg.norm(gyr - np.median(gyr, axis=0), axis=1)))
    if len(turned) == len(worn):
        first, other = sorted(worn, key=turned.__getitem__)
        if turned[first] < STANDS * turned[other]:
            return first
    raise EstimationError(
        "side_unknown",
        "Both legs carry sensors, and the feet do not tell which one squats. Map the sensors of one leg, or "
        "record each leg in a take of its own.",
    )
