"""Correction of leg inclination from the measured distance between the feet in standing.

Calibration assumes that the long axis of every segment is vertical in standing. Legs are inclined by some
degrees if the feet are further apart or closer together than the hips, and every step width is wrong by that
difference. The sensors do not measure this inclination; it follows from the distance between the ankles,
measured by tape.
"""

from __future__ import annotations

from dataclasses import replace
from math import asin
from typing import Final

import numpy as np

from sagittal.core.body.model import BodyModel
from sagittal.core.frames import SIDES, SUFFIX, Segment
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import about, multiply, to_matrix
from sagittal.core.signals.calibrated import CalibratedRecording

LONGEST: Final = 0.5
"""Sine of the widest lean that is believed."""


def lean_legs_apart(
    calibrated: CalibratedRecording, orientations: Orientations, body: BodyModel
) -> tuple[CalibratedRecording, Orientations]:
    """Thighs and shanks inclined according to the standing width; unchanged if it was not measured.

    Both hips and both ankles are assumed level and the legs straight. Joint angles change only by what their
    standing zero removes.
    """
    if body.standing_width is None:
        return calibrated, orientations
    sine = 0.5 * (body.standing_width - body.hip_width) / (body.thigh + body.shank)
    lean = asin(float(np.clip(sine, -LONGEST, LONGEST)))
    mounted, q = dict(calibrated.calibration.segments), dict(orientations.q)
    for side in SIDES:
        # about the forward axis: the right leg's upper end goes to the left
        turn = lean if side == "left" else -lean
        for name in ("thigh", "shank"):
            segment: Segment = f"{name}_{SUFFIX[side]}"  # type: ignore[assignment]
            if segment not in q:
                continue
            was = mounted[segment]
            mount = to_matrix(about(0, -turn)) @ was.R_segment_sensor
            mounted[segment] = replace(was, R_segment_sensor=mount)
            q[segment] = multiply(q[segment], about(0, turn))
    calibration = replace(calibrated.calibration, segments=mounted)
    return replace(calibrated, calibration=calibration), replace(orientations, q=q)
