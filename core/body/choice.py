"""Selection of the pose estimator by the working sensors, and the fallback after a failure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.body.tree import PRESETS
from sagittal.core.errors import EstimationError, Notice
from sagittal.core.estimators import (
    AUTO,
    BY_NAME,
    ERKF,
    L7S_2I,
    L7S_3I,
    ORIENTATIONS_ONLY,
    Estimator,
    Requested,
)
from sagittal.core.frames import Segment
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.message import Message
from sagittal.core.signals.calibrated import CalibratedRecording

WHOLE: Final = PRESETS["lower_body7"]

NO_STANDING: Final = "no_standing"
"""`Poses.reduced` of a take in which nobody stands still."""

LEAST_SLIPPED: Final = 0.25
"""Share of the take for which a sensor that slipped later must be there: what it measured until then counts
(our choice; before a slip in mid-walk angles stay within 0.2°, estimated instead they err by 4 to 7°)."""


@dataclass(frozen=True)
class Choice:
    """Estimators available for a recording.

    Parameters
    ----------
    segments : with a working sensor, in the order of docs/science/erkf.md. failed : with a failed sensor.
        possible : estimators, best first. order : those to try; only the requested one if any.
    reduced : see `Poses.reduced`.
    """

    segments: tuple[Segment, ...]
    failed: tuple[Segment, ...]
    possible: tuple[Estimator, ...]
    order: tuple[Estimator, ...]
    reduced: str | None
    notices: tuple[Notice, ...]


def list_possible_estimators(segments: Iterable[Segment]) -> tuple[Estimator, ...]:
    """Estimators that can run on these segments, the default one first."""
    instrumented = set(segments)
    estimators = [e.name for e in (L7S_3I, L7S_2I) if e.runs_on(instrumented)]
    if ERKF.runs_on(instrumented):
        # every angle of a whole body is measured; of one leg it is, but the other then has none at all
        estimators.insert(0 if instrumented >= set(WHOLE) else len(estimators), ERKF.name)
    if ORIENTATIONS_ONLY.runs_on(instrumented):
        estimators.append(ORIENTATIONS_ONLY.name)
    return tuple(estimators)


def choose(
    calibrated: CalibratedRecording, orientations: Orientations, requested: Requested, least_valid: float
) -> Choice:
    """Determine the working sensors and the estimators they allow.

    Parameters
    ----------
    least_valid : minimum fraction of the recording with data for a working sensor; lower for a sensor that
        slipped.

    Raises
    ------
    EstimationError `estimator_impossible` if the requested one needs sensors that are unavailable.
    """
    candidates = {s: calibrated.recording.sensors[s] for s in WHOLE if s in calibrated.recording.sensors}
    share = {s: float(np.mean(x.valid)) for s, x in candidates.items()}
    slipped = {n.sensor for n in calibrated.recording.notices if n.code == "sensor_slipped"}
    need = {s: max(min(least_valid, LEAST_SLIPPED) if s in slipped else least_valid, 1e-9) for s in WHOLE}
    lasting = tuple(s for s in WHOLE if share.get(s, 0.0) >= need[s])
    failed = tuple(s for s in candidates if s not in lasting)
    working = tuple(s for s in lasting if s in orientations.q)
    if calibrated.calibration.posture == "walking":
        return _without_standing(requested, working, _report_failed(failed, share, need), failed)
    possible = list_possible_estimators(working)
    if requested != AUTO and requested not in possible:
        raise EstimationError("estimator_impossible", _impossible(requested, working))
    hoped = list_possible_estimators(candidates)[:1]
    reduced = None
    if requested == AUTO and hoped != possible[:1]:
        reduced = "sensor_failed" if failed else "not_calibrated"
    order = possible if requested == AUTO else (requested,)
    return Choice(working, failed, possible, order, reduced, _report_failed(failed, share, need))


def _without_standing(
    requested: Requested,
    working: tuple[Segment, ...],
    notices: tuple[Notice, ...],
    failed: tuple[Segment, ...],
) -> Choice:
    """No estimator: each starts from standing, and a mean walking posture deviates from that by 10°.

    Raises
    ------
    EstimationError `estimator_impossible` if one was requested.
    """
    if requested != AUTO:
        raise EstimationError(
            "estimator_impossible",
            Message(
                "The estimator {requested} starts from quiet standing, but this trial has none. Use "
                "automatic choice, or record 3 s of quiet standing.",
                requested=requested,
            ),
        )
    return Choice(working, failed, (), (), NO_STANDING, notices)


def _report_failed(
    failed: tuple[Segment, ...], share: dict[Segment, float], need: dict[Segment, float]
) -> tuple[Notice, ...]:
    notices = []
    for s in failed:
        message = Message(
            "The {value} sensor is usable for {share:.0%} of the trial but {need:.0%} is required, so it "
            "is excluded: angles of its joints are missing or estimated. Charge, fasten or replace it "
            "and record again.",
            value=s,
            share=share[s],
            need=need[s],
        )
        notices.append(Notice("sensor_failed", message, sensor=s))
    return tuple(notices)


def _impossible(requested: Requested, working: tuple[Segment, ...]) -> str:
    need = BY_NAME[requested].needs
    return Message(
        "The estimator {requested} requires sensors on {need}; working: {join}. Choose another estimator.",
        requested=requested,
        need=need,
        join=", ".join(working) or "none",
    )
