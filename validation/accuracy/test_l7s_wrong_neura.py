"""Wrong handling of two and three sensors on neura_walk: L7S errors and notices.

Mistakes are applied to the recording before the product's chain; Vicon only scores. Without joints measured
by two sensors, plausibility of walking reveals mistakes (core/body/l7s/checks.py), with limits from
simulation and this walk, correct and with swapped feet.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Final

import numpy as np
import pytest

from sagittal.core import calibration, events
from sagittal.core.body import contact_mask
from sagittal.core.body.estimate import estimate_poses
from sagittal.core.body.health import HealthFinding, find_worst_verdict
from sagittal.core.body.mounting import mount_sensors
from sagittal.core.body.pose_params import PoseParams
from sagittal.core.body.tree import PRESETS
from sagittal.core.errors import SagittalError
from sagittal.core.estimators import Estimator
from sagittal.core.frames import SIDES, Segment
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.signals.recording import SensorSignals, UniformRecording
from tests.helpers.l7s_walks import FLEXION
from tests.helpers.neura import BODY, angles_deg
from tests.helpers.neura_angles import scores
from tests.helpers.walks import lost, neura_walk, only
from validation.figures import record

WORN: Final[dict[Estimator, tuple[Segment, ...]]] = {
    "l7s_3i": PRESETS["feet_pelvis3"],
    "l7s_2i": PRESETS["feet2"],
}


@dataclass(frozen=True)
class Result:
    """Mean RMSE of hip, knee and ankle flexion in ° against Vicon, and the trial's notices."""

    rmse: tuple[float, ...]
    codes: frozenset[str]
    beyond: tuple[HealthFinding, ...]


def with_sensors(recording: UniformRecording, **sensors: SensorSignals) -> UniformRecording:
    segments = {s: x for s, x in sensors.items() if s in recording.sensors}
    return replace(recording, sensors={**recording.sensors, **segments})  # type: ignore[dict-item]


def exchanged(a: Segment, b: Segment) -> Callable[[UniformRecording], UniformRecording]:
    return lambda take: with_sensors(take, **{a: take.sensors[b], b: take.sensors[a]})


def taken_for(segment: Segment, really: Segment) -> Callable[[UniformRecording], UniformRecording]:
    return lambda take: with_sensors(take, **{segment: neura_walk().sensors[really]})


def late(take: UniformRecording) -> UniformRecording:
    x = take.sensors["foot_l"]
    acc, gyr = (np.concatenate((np.repeat(a[:1], 25, axis=0), a[:-25])) for a in (x.acc, x.gyr))
    return with_sensors(take, foot_l=replace(x, acc=acc, gyr=gyr))


def unnoticed(take: UniformRecording) -> UniformRecording:
    held = lost(take, "foot_r", 13.0, 13.5).sensors["foot_r"]
    return with_sensors(take, foot_r=replace(held, valid=take.sensors["foot_r"].valid))


Case = tuple[Callable[[UniformRecording], UniformRecording], frozenset[str], tuple[Estimator, ...]]
BOTH: Final[tuple[Estimator, ...]] = ("l7s_3i", "l7s_2i")


CASES: Final[dict[str, Case]] = {
    "right": (lambda take: take, frozenset(), BOTH),
    "feet exchanged": (exchanged("foot_l", "foot_r"), frozenset({"feet_exchanged"}), BOTH),
    "pelvis and left foot exchanged": (
        exchanged("pelvis", "foot_l"),
        frozenset({"not_a_pelvis", "feet_drift_apart"}),
        ("l7s_3i",),
    ),
    "pelvis sensor on the right thigh": (
        taken_for("pelvis", "thigh_r"),
        frozenset({"not_a_pelvis"}),
        ("l7s_3i",),
    ),
    "left foot sensor on the shank": (
        taken_for("foot_l", "shank_l"),
        frozenset({"foot_never_still", "feet_out_of_step"}),
        BOTH,
    ),
    "one sensor for both feet": (taken_for("foot_r", "foot_l"), frozenset({"feet_out_of_step"}), BOTH),
    "left foot 0.25 s late": (late, frozenset({"feet_out_of_step"}), BOTH),
    "right foot lost for 0.5 s, known": (
        lambda take: lost(take, "foot_r", 13.0, 13.5),
        frozenset({"gap_not_bridged"}),
        BOTH,
    ),
    "right foot lost for 0.5 s, unnoticed": (
        unnoticed,
        frozenset({"legs_do_not_fit", "zero_velocity_refused", "not_level", "feet_drift_apart"}),
        BOTH,
    ),
}
"""Name → the mistake, the codes of which at least one must tell it, the estimators it can be made with."""


@cache
def result(name: str, estimator: Estimator) -> Result | str:
    """What becomes of a case: its figures, or the code of the error that stops it."""
    take = CASES[name][0](only(neura_walk(), *WORN[estimator]))
    try:
        calibrated = calibration.calibrate(take)
        orientations = estimate_orientations(calibrated)
        detections = events.detect(orientations)
        contacts = {
            s: contact_mask(take.t_s, detections.times(s, "ic"), detections.times(s, "tc")) for s in SIDES
        }
        params = PoseParams(estimator=estimator)
        mounted = replace(mount_sensors(calibrated, orientations, params), body=BODY)
        poses = estimate_poses(mounted, contacts, params)
    except SagittalError as error:
        return error.code
    q = dict(poses.poses.q)
    valid = np.ones(len(take.t_s), bool)
    posed = Orientations(take.t_s, take.rate_hz, q, dict.fromkeys(q, valid), "")
    _, against = scores(angles_deg(posed, calibrated))
    rmse = tuple(float(np.mean([against[f"{n}_{e}"].offset_removed for e in "rl"])) for n in FLEXION)
    notices = (*calibrated.calibration.notices, *poses.poses.notices)
    beyond = tuple(f for f in poses.poses.health if f.verdict != "good")
    return Result(rmse, frozenset(n.code for n in notices), beyond)


PAIRS: Final = [(name, e) for name, (_, _, estimators) in CASES.items() for e in estimators]


@pytest.mark.parametrize(("name", "estimator"), PAIRS)
def test_what_is_wrong_is_told_and_what_is_right_is_not_accused(name: str, estimator: Estimator) -> None:
    results = result(name, estimator)
    if name == "right":
        assert isinstance(results, Result)
        assert not results.beyond
        assert not any(results.codes & codes for _, codes, _ in CASES.values())
        return
    assert isinstance(results, str) or results.codes & CASES[name][1]


def test_write_down_the_figures() -> None:
    rows = []
    for name, estimator in PAIRS:
        results = result(name, estimator)
        cells = [name, estimator.upper().replace("_", "-")]
        if isinstance(results, str):
            rows.append([*cells, "–", f"error {results}", "bad"])
            continue
        view = [f"{f.name} {f.of + ' ' if f.of else ''}{f.value:.2g}" for f in results.beyond]
        cells += [
            " / ".join(f"{x:.1f}" for x in results.rmse),
            ", ".join(view) or "–",
            find_worst_verdict(results.beyond),
        ]
        rows.append(cells)
    record(
        "L7S: wrong handling on neura_walk",
        ["mistake", "run", "hip / knee / ankle flexion RMSE °", "quantities beyond their limit", "verdict"],
        rows,
        "Offset removed, whole walk against Vicon; one person, one walk out and back. A mistake counts as "
        "told when a notice names it; every one here is. What is not told: clocks apart by less than an "
        "eighth of a stride, and, with feet alone in a take whose turns are not decisive, that they were "
        "exchanged.",
    )
