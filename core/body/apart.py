"""How far apart the feet stood.

Calibration takes every segment's long axis to be vertical while standing. Legs lean by some degrees when the
feet stand wider or closer than the hips, and the width of every step is wrong by that difference. Nothing
the sensors measure tells the lean; the distance of the ankles, measured with a tape, does.
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
    """Thighs and shanks leaning as the standing width says; unchanged when nobody measured it.

    Both hips and both ankles are taken to be level and the legs straight. Joint angles do not change beyond
    what their standing zero takes away.
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
