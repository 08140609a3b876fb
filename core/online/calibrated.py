"""What live calibration gives to the chain behind it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from core.body.model import BodyModel
from core.calibration.result import CalibratedRecording
from core.errors import Notice
from core.frames import Segment
from core.fusion.orientations import Orientations
from core.online.frame import SegmentCheck


@dataclass(frozen=True, eq=False)
class LiveCalibration:
    """How the sensors sit, and the samples it was found on.

    Parameters
    ----------
    calibrated : samples of the calibrated segments from `first` on, t_s from 0; its windows are in that time.
        Mountings are final: legs apart, forward axes agreed with the joints where the ErKF runs.
    orientations : of these samples, both ways (not causal); for comparison, not to go on from.
    first, past : on the live axis, index of the recording's first sample and the one after its last. The
        chain goes through [first, past) to catch up and goes on with the axis' sample `past`.
    body : lengths, with the standing width.
    turned : segment → rad its forward axis was turned to agree with the joints; empty without ErKF.
    checks : one per worn segment, also of those that could not be calibrated. ok : none of them is doubtful.
    """

    calibrated: CalibratedRecording
    orientations: Orientations
    first: int
    past: int
    body: BodyModel
    turned: Mapping[Segment, float]
    checks: tuple[SegmentCheck, ...]
    notices: tuple[Notice, ...]
    ok: bool
