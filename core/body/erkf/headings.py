"""Correction of sensor headings by the constraints of the joints.

Calibration estimates each segment's forward axis independently, from the direction of walking. Joint centres
determine the relative headings of the sensors in the ErKF, so a segment whose heading they change has a wrong
forward axis. Its alignment is corrected by the mean change while walking (docs/science/calibration.md,
"Forward axes by the joints"). The common forward direction is not observable from the joints; it is the
median of the segments, so that no single calibration determines it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import degrees, radians
from typing import Final

import numpy as np

from sagittal.core.body.corrected import correct_signals
from sagittal.core.body.erkf.filter import erkf_inputs
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.erkf.smoother import smooth
from sagittal.core.body.erkf.start import start_state
from sagittal.core.body.health import HealthFinding
from sagittal.core.body.model import BodyModel
from sagittal.core.body.tree import person_tree
from sagittal.core.errors import Notice, Severity
from sagittal.core.frames import Segment
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.message import Message
from sagittal.core.rotation import about, from_matrix, multiply, to_matrix, wrap_angle, yaw
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.rest import index_window

LOOKED_AT_S: Final = 120.0
"""Part of the take that is filtered for this, from the standing zero on: some fifty strides."""

ROUNDS: Final = 3
"""Most passes. One leaves up to 7 % of an error, as the joints were placed with the wrong axis; two leave
0.2° of 30° and 0.4° of 60° (neura_walk, each sensor alone)."""

WARN: Final = radians(15.0)
"""Two measures of a heading that differ by more are told (docs/science/real-recordings.md, "Heading")."""

BAD: Final = radians(60.0)
"""A start this far off need not come back (docs/science/real-recordings.md, "Heading"), and no mounting is
taken so wrongly: two sensors are exchanged, or one was turned during the take."""

TELL: Final = radians(10.0)
"""A forward axis off by more is told: beyond what soft tissue does to the joints' own view of it."""

SETTLED: Final = radians(5.0)
"""A pass that turns nothing further is the last: what remains is below half a degree."""


def align_forward_axes(
    calibrated: CalibratedRecording,
    orientations: Orientations,
    body: BodyModel,
    segments: Sequence[Segment],
    params: ErkfParams,
) -> tuple[CalibratedRecording, Orientations, dict[Segment, float]]:
    """Rotate forward axes until they agree with the joints; returns the total correction of each, rad.

    If the last iteration still rotates one by more than any plausible alignment error, the joints belong to
    other segments: the axes of the calibration are kept.

    Raises
    ------
    EstimationError as `heading_errors`.
    """
    total: dict[Segment, float] = {}
    errors: Mapping[Segment, float] = {}
    turned = calibrated, orientations
    for _ in range(ROUNDS):
        errors = heading_errors(*turned, body, segments, params)
        turned = turn_forward_axes(*turned, errors)
        total = {s: wrap_angle(total.get(s, 0.0) + error) for s, error in errors.items()}
        if all(abs(error) <= SETTLED for error in errors.values()):
            break
    if any(abs(error) > BAD for error in errors.values()):
        turned = calibrated, orientations
    return (*turned, total)


def judge_turned_axes(total: Mapping[Segment, float]) -> tuple[HealthFinding, ...]:
    """Corrections of `align_forward_axes` as health findings of the run."""
    return tuple(
        HealthFinding("forward_axis_turned_deg", s, degrees(abs(x)), warn=degrees(WARN), bad=degrees(BAD))
        for s, x in total.items()
    )


def report_turned_axes(total: Mapping[Segment, float]) -> tuple[Notice, ...]:
    """Notice `heading_corrected` on the corrections of `align_forward_axes`."""
    off = [s for s in total if abs(total[s]) > TELL]
    if not off:
        return ()
    worst = max(off, key=lambda s: abs(total[s]))
    message = Message(
        "Joint motion shows that calibration misjudged the forward direction at {off}, by up to "
        "{degrees:.0f}° ({worst}); it was corrected. Frontal and transverse angles there are less "
        "certain.",
        off=", ".join(off),
        degrees=degrees(abs(total[worst])),
        worst=worst,
    )
    severity: Severity = "warning" if abs(total[worst]) > WARN else "info"
    return (Notice("heading_corrected", message, sensor=worst, severity=severity),)


def heading_errors(
    calibrated: CalibratedRecording,
    orientations: Orientations,
    body: BodyModel,
    segments: Sequence[Segment],
    params: ErkfParams,
) -> dict[Segment, float]:
    """Deviation of each segment's forward axis from the median of all, rad, left positive.

    Nine states with smoother, over two minutes from the standing zero on, or the last two; empty if they
    contain no walking.

    Raises
    ------
    EstimationError as `person_tree` and `smooth`.
    """
    rate = calibrated.recording.rate_hz
    zero = index_window(calibrated.calibration.zero, rate)
    n = len(calibrated.recording.t_s)
    length = round(LOOKED_AT_S * rate)
    first = max(0, min(zero.start, n - length))
    part = slice(first, min(n, first + length))
    mounts = {s: calibrated.calibration.segments[s].R_segment_sensor for s in segments}
    tree = person_tree(body, mounts, segments)
    inputs = erkf_inputs(tree, *correct_signals(calibrated, segments, part), rate)
    q = np.stack([multiply(orientations.q[s][first], from_matrix(mounts[s])) for s in segments])
    standing = (0, zero.stop - first) if zero.start == first else None
    coarse = replace(params, states=9)
    track, _ = smooth(start_state(tree, inputs, coarse, standing, q=q), inputs, tree, coarse)
    walking = np.zeros(n, bool)
    for window in calibrated.calibration.walking:
        walking[index_window(window, rate)] = True
    change = []
    for i, segment in enumerate(segments):
        was, now = orientations.q[segment][part], tree.segment(i, track.places[i], track.turns[i])[0]
        mask = walking[part] & orientations.valid[segment][part]
        if not mask.any():
            return {}
        change.append(np.angle(np.mean(np.exp(1j * (yaw(now) - yaw(was)))[mask])))
    apart = np.array([wrap_angle(float(x - change[0])) for x in change])
    return dict(zip(segments, (apart - np.median(apart)).tolist(), strict=True))


def turn_forward_axes(
    calibrated: CalibratedRecording, orientations: Orientations, errors: Mapping[Segment, float]
) -> tuple[CalibratedRecording, Orientations]:
    """The calibration with its forward axes rotated by `heading_errors`, and the orientations to match."""
    mounted, q = dict(calibrated.calibration.segments), dict(orientations.q)
    for segment, error in errors.items():
        was = mounted[segment]
        mount = to_matrix(about(1, error)) @ was.R_segment_sensor
        start = None if was.start_q is None else multiply(about(2, error), was.start_q)
        mounted[segment] = replace(was, R_segment_sensor=mount, start_q=start)
        q[segment] = multiply(multiply(about(2, error), q[segment]), about(1, -error))
    calibration = replace(calibrated.calibration, segments=mounted)
    return replace(calibrated, calibration=calibration), replace(orientations, q=q)
