"""Consistency of declared sensor placements with the walk, and proposed corrections.

A declaration determines signs and, without a walk, the whole axis; a wrong one excludes its sensor or rotates
its angles. If the walk clearly determines the forward axis independently, the two can be compared
(docs/science/setup.md, "Declared mountings").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import degrees, radians
from typing import Final, get_args

import numpy as np

from sagittal.core.calibration.calibrate import CalibrationParams, calibrate
from sagittal.core.calibration.mounting import WAYS, Way, read_declared_direction, say_other_way
from sagittal.core.errors import CalibrationError, SignalError
from sagittal.core.frames import Segment
from sagittal.core.rotation import wrap_angle
from sagittal.core.setup.repair import SetupRepair
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.recording import UniformRecording

CONTRADICTED: Final = radians(60.0)
"""A declaration names one of four ways, so a right one is up to 45° off; from here on it is wrong (our
choice)."""

NEAREST: Final = radians(30.0)
"""Another way is proposed where the walk is so near to it (our choice)."""

CLEAR_SD: Final = radians(10.0)
"""A forward axis known less well contradicts nobody (our choice)."""

STEEPEST_AXIS: Final = 0.5
"""Horizontal part of a declared axis below which it says nothing: within 30° of vertical."""

WEAK: Final = frozenset(("calibration_sign_weak", "calibration_sign_conflict"))
"""What makes the sign of an axis found without the declaration uncertain."""


def propose_mountings(
    recording: UniformRecording, params: CalibrationParams | None = None
) -> SetupRepair | None:
    """Corrected texts for declared placements that differ from the walk by a quarter turn or more; None
    without any.

    No proposal is made if a recording cannot be calibrated without the declarations, nor for a sensor whose
    forward axis the walk does not determine clearly.
    """
    declared = {
        s: text
        for s, text in recording.mounting.items()
        if s in recording.sensors and read_declared_direction(text) is not None
    }
    if not declared:
        return None
    try:
        free = calibrate(replace(recording, mounting={}), params)
    except (CalibrationError, SignalError):
        return None
    corrections: dict[str, str] = {}
    evidence = []
    for segment, text in _list_known(declared, free).items():
        off, way = _compare(segment, text, free)
        if way is None:
            continue
        corrections[segment] = say_other_way(text, way)
        evidence.append(
            f"The walk shows that the sensor of {segment} sits {degrees(abs(off)):.0f}° otherwise than "
            f"“{text}” says; “{corrections[segment]}” fits."
        )
    return SetupRepair("mounting", tuple(evidence), np.inf, mounting=corrections) if corrections else None


def _list_known(declared: Mapping[str, str], free: CalibratedRecording) -> dict[Segment, str]:
    """Segments whose forward axis is clearly determined by the walk, including its sign."""
    calibration = free.calibration
    weak = {n.sensor for n in calibration.notices if n.code in WEAK}
    return {
        s: declared[s]
        for s, x in calibration.segments.items()
        if s in declared and s not in weak and x.forward_sd is not None and x.forward_sd <= CLEAR_SD
    }


def _compare(segment: Segment, text: str, free: CalibratedRecording) -> tuple[float, Way | None]:
    """Deviation of the declared axis from the declared direction, rad, and the direction it actually has;
    None if the declaration may be right or no named direction is near.
    """
    direction = read_declared_direction(text)
    assert direction is not None  # noqa: S101 (narrows the type; `propose_mountings` looked)
    axis, declared = direction
    points = free.calibration.segments[segment].R_segment_sensor @ axis
    # z of a segment is to the right, ways count to the left
    if np.hypot(points[0], points[2]) < STEEPEST_AXIS:
        return 0.0, None
    angle = float(np.arctan2(-points[2], points[0]))
    off = float(wrap_angle(angle - declared))
    ways: tuple[Way, ...] = get_args(Way)
    apart = [abs(float(wrap_angle(angle - radians(WAYS[w])))) for w in ways]
    nearest = int(np.argmin(apart))
    if abs(off) < CONTRADICTED or apart[nearest] > NEAREST:
        return off, None
    return off, ways[nearest]
