"""Simulated walks for L7S with ground truth, and scores after Sy 2021 §III-B.

Sensors are on skin, randomly oriented, with the errors of docs/science/simulation.md. Calibration,
orientations and stillness come from the signals; only body lengths are known, as in the paper.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from math import pi, radians

import numpy as np

from sagittal.core.angles.measure import measure_angles
from sagittal.core.body.l7s.filter import Adjoint, L7sParams, Worn
from sagittal.core.body.l7s.inputs import free_acceleration
from sagittal.core.body.l7s.poses import l7s_poses
from sagittal.core.body.model import BodyModel
from sagittal.core.body.poses import Poses
from sagittal.core.body.still import FOOT_STILL, still_samples
from sagittal.core.calibration import calibrate
from sagittal.core.frames import FOOT, SHANK, SIDES, SUFFIX, THIGH, Bools, Floats, Segment, Side
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import about, angle_between, multiply, rotate, to_matrix
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.held_samples import SampleSeries
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.simulate import SCRIPTS, WalkTruth, simulate
from sagittal.core.simulate.script import Arc, Pivot, Script, Stand, Straight, scale_script
from sagittal.core.simulate.walker import Walker
from sagittal.core.timeline import synchronise

_AHEAD = Straight(6.4, 0.64, 0.54)
_CIRCLE = (Arc(1.2, 2 * pi, 0.56, 0.56), Arc(1.2, -2 * pi, 0.56, 0.56))
_ZIG = (
    Straight(3.0, 0.60, 0.54),
    Arc(0.5, radians(120), 0.40, 0.56),
    Straight(3.0, 0.60, 0.54),
    Arc(0.5, radians(-120), 0.40, 0.56),
)

MOVEMENTS: Mapping[str, Script] = {
    "walk": (
        Stand(5.0),
        Straight(10.0, 0.64, 0.54),
        Pivot(pi, radians(40), 0.55),
        Straight(10.0, 0.64, 0.54),
        Stand(3.0),
    ),
    "figure of eight": (Stand(5.0), _AHEAD, *_CIRCLE * 3, Stand(3.0)),
    "zig-zag": (Stand(5.0), _AHEAD, *_ZIG * 4, Stand(3.0)),
}
"""Free walking of Sy 2021 Table II in 30 to 60 s each; the unscripted five minutes are left out. Our
calibration needs some steps straight ahead, theirs did not."""

PEOPLE: tuple[tuple[float, int], ...] = ((1.64, 1), (1.70, 2), (1.76, 3))
"""Body height in m and seed; the paper's nine are 1.70 ± .06 m tall."""

FLEXION = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")

STRAIGHT = radians(10.0)
"""A stride in which the foot turns by less is straight."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One take with what L7S needs, and its truth cut to the same samples."""

    calibrated: CalibratedRecording
    orientations: Orientations
    acceleration: Mapping[Segment, SampleSeries]
    steps: Mapping[Side, Bools]
    truth: WalkTruth

    def run(self, segments: Worn, adjoint: Adjoint = "printed", body: BodyModel | None = None) -> Poses:
        """The filter on it, which is what Sy 2021 describes and what live shows."""
        body = body or self.truth.body
        params = L7sParams(adjoint=adjoint)
        return l7s_poses(
            self.orientations, self.acceleration, self.steps, body, params, segments, both_ways=False
        )


def steps_of(calibrated: CalibratedRecording) -> dict[Side, Bools]:
    """Where each foot rests, by the rule on its own signals."""
    result: dict[Side, Bools] = {}
    for side in SIDES:
        x = calibrated.recording.sensors[FOOT[side]]
        gyr = x.gyr - calibrated.calibration.segments[FOOT[side]].gyro_bias
        result[side] = still_samples(x.acc, gyr, x.valid, calibrated.recording.rate_hz, FOOT_STILL)
    return result


def trial_of(recording: UniformRecording, truth: WalkTruth) -> Trial:
    """A take as L7S meets it."""
    calibrated = calibrate(recording)
    orientations = estimate_orientations(calibrated)
    return Trial(
        calibrated, orientations, free_acceleration(calibrated, orientations), steps_of(calibrated), truth
    )


@cache
def trial(movement: str, height_m: float, seed: int) -> Trial:
    """A movement of `MOVEMENTS` by a person of a height."""
    walker = Walker.of_height(height_m)
    take = simulate(
        scale_script(MOVEMENTS[movement], walker.scale), walker, seed, SCRIPTS["comfortable"].setup
    )
    return trial_of(synchronise(take.recording), take.truth)


def turned_headings(source: Trial, by_deg: Mapping[Segment, float]) -> Trial:
    """The same take with some sensors' headings off by these degrees, left positive."""
    q, acceleration = dict(source.orientations.q), dict(source.acceleration)
    for segment, degrees in by_deg.items():
        turn = about(2, radians(degrees))
        q[segment] = multiply(turn, q[segment])
        acceleration[segment] = rotate(turn, acceleration[segment][:])
    return replace(source, orientations=replace(source.orientations, q=q), acceleration=acceleration)


def straight_cycles(truth: WalkTruth) -> list[tuple[Side, float, float]]:
    """Side, start and end in s of straight strides, without the short ones next to standing."""
    typical = float(np.median([s.length_m for s in truth.strides]))
    return [
        (s.side, s.start_s, s.end_s)
        for s in truth.strides
        if abs(s.turn_rad) < STRAIGHT and s.length_m > 0.7 * typical
    ]


def raw_angles(poses: Poses, calibrated: CalibratedRecording) -> dict[str, Floats]:
    """Angles (n,) by name in degrees, not zeroed."""
    q = dict(poses.q)
    posed = Orientations(poses.t_s, poses.rate_hz, q, dict.fromkeys(q, np.ones_like(poses.valid)), "")
    angles = measure_angles(posed, calibrated.calibration.zero)
    return {name: np.degrees(x + angles.zero_offset[name]) for name, x in angles.angles.items()}


def cycle_scores(source: Trial, poses: Poses) -> Floats:
    """RMSE in ° (offset removed) and correlation (cycles, 3, 2) of the straight gait cycles of both legs."""
    result, rate = raw_angles(poses, source.calibrated), poses.rate_hz
    scores = []
    for side, start_s, end_s in straight_cycles(source.truth):
        part = slice(round(start_s * rate), round(end_s * rate))
        scores.append([_score(result, source.truth, f"{name}_{SUFFIX[side]}", part) for name in FLEXION])
    return np.array(scores)


def trial_scores(source: Trial, poses: Poses) -> Floats:
    """The same (3, 2) over everything between the first and the last standing, mean of the legs."""
    result, rate, stands = raw_angles(poses, source.calibrated), poses.rate_hz, source.truth.stands
    part = slice(round(stands[0][1] * rate), round(stands[-1][0] * rate))
    scores = [[_score(result, source.truth, f"{n}_{e}", part) for n in FLEXION] for e in "lr"]
    return np.asarray(np.mean(scores, axis=0))


def _score(result: Mapping[str, Floats], truth: WalkTruth, name: str, part: slice) -> tuple[float, float]:
    a, b = result[name][part], np.degrees(truth.angles[name][part])
    return float((a - b).std()), float(np.corrcoef(a, b)[0, 1])


def pose_errors(source: Trial, poses: Poses) -> tuple[float, float]:
    """e_pos in cm of hips, knees and ankles from mid-pelvis, e_ori in ° of segments without a sensor.

    Sy 2021 eq 45 and 46 (with the transpose missing in print) between first and last standing, after aligning
    the mean heading of the feet.
    """
    rate, stands, truth = poses.rate_hz, source.truth.stands, source.truth
    part = slice(round(stands[0][1] * rate), round(stands[-1][0] * rate))
    apart = np.concatenate([_heading(truth.q[s][part]) - _heading(poses.q[s][part]) for s in FOOT.values()])
    turn = about(2, float(np.angle(np.exp(1j * apart).mean())))
    places = [*THIGH.values(), *SHANK.values(), *FOOT.values()]
    positions = [
        rotate(turn, poses.p[s][part] - poses.p["pelvis"][part])
        - (truth.p[s][part] - truth.p["pelvis"][part])
        for s in places
    ]
    without: list[Segment] = [*THIGH.values(), *SHANK.values()]
    if poses.method == "l7s_2i":
        without.append("pelvis")
    turned = [angle_between(multiply(turn, poses.q[s][part]), truth.q[s][part]) for s in without]
    return (
        100.0 * float(np.mean([np.linalg.norm(x, axis=1) for x in positions])),
        float(np.degrees(np.mean(turned))),
    )


def _heading(q: Floats) -> Floats:
    forward = to_matrix(q)[:, :, 0]
    return np.asarray(np.arctan2(forward[:, 1], forward[:, 0]))


def edges(source: Trial, side: Side) -> np.ndarray:
    """First flagged sample of the foot's rest after each of its contacts: the paper's edges of step flags."""
    contacts, step, rate = (
        source.truth.contacts[side],
        source.steps[side],
        source.calibrated.recording.rate_hz,
    )
    result = []
    for contact, release in zip(contacts.contact, np.append(contacts.release[1:], np.inf), strict=True):
        first, last = round(contact * rate), round(min(release * rate, len(step)))
        rests = np.flatnonzero(step[first:last])
        result += [first + rests[0]] if len(rests) else []
    return np.array(result)


@dataclass(frozen=True, eq=False)
class Strides:
    """Stride lengths in m and durations in s of one foot over a take, estimated and true, turns included."""

    found: Floats
    true: Floats
    duration_s: Floats

    @property
    def distance_error(self) -> float:
        """Relative error of the sum, the paper's TTD."""
        return float(self.found.sum() / self.true.sum() - 1.0)


def strides_of(source: Trial, poses: Poses, side: Side) -> Strides:
    """Distances of the ankle in the floor's plane between edges of step flags (Sy 2021 §III-B.3)."""
    k, foot = edges(source, side), FOOT[side]
    result, true = (
        np.linalg.norm(np.diff(p[foot][k, :2], axis=0), axis=1) for p in (poses.p, source.truth.p)
    )
    return Strides(result, true, np.diff(k) / poses.rate_hz)
