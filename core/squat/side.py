"""Selection of the legs with the required sensors."""

from __future__ import annotations

from sagittal.core.body.chain.model import leg_segments
from sagittal.core.errors import EstimationError
from sagittal.core.frames import SIDES, Side
from sagittal.core.signals.recording import UniformRecording


def find_squat_sides(recording: UniformRecording) -> tuple[Side, ...]:
    """The legs that can be analysed in a squat recording.

    Raises
    ------
    EstimationError `segments_missing` if no leg has sensors on shank and thigh, or the pelvis has none.
    """
    sides = tuple(side for side in SIDES if set(leg_segments(side)) <= set(recording.sensors))
    if not sides:
        raise EstimationError(
            "segments_missing",
            "Squats require sensors on the pelvis and on the shank and thigh of each squatting leg; "
            "attach or assign them.",
        )
    return sides
