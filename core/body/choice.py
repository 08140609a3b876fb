"""Which pose estimator the working sensors allow, and what is used when one of them failed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal, get_args

import numpy as np

from core.body.tree import PRESETS
from core.calibration.result import CalibratedRecording
from core.errors import EstimationError, Notice
from core.frames import FOOT, SHANK, SIDES, THIGH, Segment
from core.fusion.orientations import Orientations

Estimator = Literal["erkf", "l7s_3i", "l7s_2i", "stance_foot_anchor"]
Requested = Literal["auto", "erkf", "l7s_3i", "l7s_2i", "stance_foot_anchor"]

ESTIMATORS: Final[tuple[Estimator, ...]] = get_args(Estimator)

WHOLE: Final = PRESETS["lower_body7"]


@dataclass(frozen=True)
class Choice:
    """What a take can be estimated with.

    Parameters
    ----------
    segments : with a working sensor, in the order of docs/science/erkf.md. failed : without.
    possible : estimators, best first. order : those to try, of them; the one asked for alone.
    reduced : see `Poses.reduced`.
    """

    segments: tuple[Segment, ...]
    failed: tuple[Segment, ...]
    possible: tuple[Estimator, ...]
    order: tuple[Estimator, ...]
    reduced: str | None
    notices: tuple[Notice, ...]


def possible(segments: Iterable[Segment]) -> tuple[Estimator, ...]:
    """Estimators that can run on these segments, the one taken by default first."""
    worn = set(segments)
    leg = "pelvis" in worn and any({THIGH[s], SHANK[s], FOOT[s]} <= worn for s in SIDES)
    found: list[Estimator] = []
    if worn >= set(PRESETS["feet_pelvis3"]):
        found.append("l7s_3i")
    if worn >= set(PRESETS["feet2"]):
        found.append("l7s_2i")
    if leg:
        # every angle of a whole body is measured; of one leg it is, but the other then has none at all
        found.insert(0 if worn >= set(WHOLE) else len(found), "erkf")
        found.append("stance_foot_anchor")
    return tuple(found)


def choose(
    calibrated: CalibratedRecording, orientations: Orientations, requested: Requested, least_valid: float
) -> Choice:
    """Look which sensors work and what they allow.

    Parameters
    ----------
    least_valid : share of the take a sensor must be there for; below it has failed.

    Raises
    ------
    EstimationError `estimator_impossible` when the requested one needs sensors that are not there.
    """
    worn = {s: calibrated.recording.sensors[s] for s in WHOLE if s in calibrated.recording.sensors}
    share = {s: float(np.mean(x.valid)) if s in orientations.q else 0.0 for s, x in worn.items()}
    working = tuple(s for s in WHOLE if share.get(s, 0.0) >= max(least_valid, 1e-9))
    failed = tuple(s for s in worn if s not in working)
    found = possible(working)
    if requested != "auto" and requested not in found:
        raise EstimationError("estimator_impossible", _impossible(requested, working))
    hoped = possible(worn)[:1]
    reduced = "sensor_failed" if requested == "auto" and hoped != found[:1] else None
    notices = []
    for s in failed:
        message = (
            f"The {s} sensor is there for {share[s]:.0%} of the take, at least {least_valid:.0%} is needed, "
            "so it is left out: angles of its joints are missing or estimated. Charge or replace it and "
            "record again."
        )
        notices.append(Notice("sensor_failed", message, sensor=s))
    order = found if requested == "auto" else (requested,)
    return Choice(working, failed, found, order, reduced, tuple(notices))


def _impossible(requested: Requested, working: tuple[Segment, ...]) -> str:
    need = {
        "erkf": "the pelvis and a whole leg (thigh, shank, foot)",
        "l7s_3i": "the pelvis and both feet",
        "l7s_2i": "both feet",
        "stance_foot_anchor": "the pelvis and a whole leg (thigh, shank, foot)",
    }[requested]
    return (
        f"The estimator {requested} needs sensors on {need}; working: {', '.join(working) or 'none'}. "
        "Choose another estimator."
    )
