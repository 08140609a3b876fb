"""Calibrated sensors → Poses by the best estimator available, and the paths of the feet.

Seven sensors: ErKF with smoother (Potter 2021). Pelvis and feet, or feet alone: L7S (Sy 2021) for the poses,
and an unlinked ErKF for each foot, because stride lengths are never taken from L7S (docs/science/l7s.md,
"Limits"). choice.py handles recordings with a failed sensor.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sagittal.core.body.arms import report_ahead
from sagittal.core.body.choice import WHOLE
from sagittal.core.body.corrected import correct_signals
from sagittal.core.body.erkf.filter import erkf_inputs
from sagittal.core.body.erkf.headings import judge_turned_axes, report_turned_axes
from sagittal.core.body.erkf.health import erkf_health, erkf_notices
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.erkf.poses import (
    find_segment_tracks,
    foot_tracks,
    place_figure,
    replace_orientations,
    run_erkf,
)
from sagittal.core.body.erkf.smoother import smooth
from sagittal.core.body.erkf.start import start_state
from sagittal.core.body.feet import FootTracks
from sagittal.core.body.kinematics import forward_kinematics
from sagittal.core.body.l7s.health import l7s_health, l7s_notices
from sagittal.core.body.l7s.inputs import free_acceleration
from sagittal.core.body.l7s.poses import compile_l7s_kernel, l7s_poses
from sagittal.core.body.model import NOMINAL_HEIGHT_M, BodyModel
from sagittal.core.body.mounting import MountedSensors
from sagittal.core.body.pose_params import PoseParams
from sagittal.core.body.poses import Poses
from sagittal.core.body.still import contact_samples
from sagittal.core.body.tree import person_tree
from sagittal.core.errors import EstimationError, Notice
from sagittal.core.estimators import BY_NAME, ERKF, L7S_3I, NO_FIGURE, ORIENTATIONS_ONLY, Estimator
from sagittal.core.frames import FOOT, GRAVITY, SIDES, Bools, Segment, Side
from sagittal.core.fusion.orientations import LastReading, Orientations
from sagittal.core.message import Message
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.held_samples import lay_aside
from sagittal.core.signals.memory import give_memory_back

ON_A_BELT: Final = (
    "On a treadmill the stance foot moves with the belt, whereas the estimator assumes it is stationary. "
    "Positions are relative to a belt of constant speed; distances are reported only if the belt speed "
    "was entered."
)


@dataclass(frozen=True, eq=False)
class PoseEstimate:
    """Result of the pose stage.

    Parameters
    ----------
    orientations : of the segments with a working sensor, refined if the ErKF ran; used for joint angles.
        poses : of the whole body model. feet : None without a working foot sensor.
    """

    orientations: Orientations
    poses: Poses
    feet: FootTracks | None


def estimate_poses(
    mounted: MountedSensors, contacts: Mapping[Side, Bools], params: PoseParams
) -> PoseEstimate:
    """Estimate the poses of a recording.

    Parameters
    ----------
    mounted : result of the mounting stage with the same parameters. If its orientations are a `LastReading`,
        those refined by the ErKF are released.
    contacts : side → (n,) foot on the floor, from the events.

    Raises
    ------
    EstimationError of an explicitly requested estimator. In automatic mode, a failed estimator is replaced by
    the next possible one, with a notice `estimator_failed`.
    """
    choice = mounted.choice
    requested = BY_NAME.get(params.estimator)
    # the point of asking for few sensors by name is what so few tell
    read_segments = choice.segments if requested is None or requested.sensors is None else requested.sensors
    used = tuple(s for s in choice.segments if s in read_segments)
    take = _Take(mounted, _without(mounted.orientations, set(WHOLE) - set(used)), contacts, params)
    notices, reduced = list(choice.notices), choice.reduced
    if mounted.calibrated.recording.protocol == "treadmill":
        notices.append(Notice("treadmill_belt", ON_A_BELT, severity="info"))
    estimate = None
    for estimator in choice.order:
        try:
            estimate = take.run(estimator, used)
            break
        except EstimationError as error:
            if estimator == choice.order[-1]:
                raise
            message = Message(
                "{estimator} cannot estimate this take, the next one is used. {message}",
                estimator=estimator,
                message=error.message,
            )
            notices.append(Notice("estimator_failed", message, error.sensor, error.t_s))
            reduced = "estimator_failed"
    if estimate is None:
        # no figure; the notices of what is missing are still wanted
        estimate = take.anchored()
        estimate = replace(estimate, poses=replace(estimate.poses, q={}, p={}, method=NO_FIGURE))
    if estimate.feet is None:
        try:
            estimate = take.with_feet(estimate, used)
        except EstimationError as error:
            message = Message(
                "The paths of the feet cannot be estimated, so there are no distances. {message}",
                message=error.message,
            )
            notices.append(Notice("foot_paths_failed", message, error.sensor, error.t_s))
    poses = replace(
        estimate.poses,
        reduced=reduced,
        notices=(*notices, *estimate.poses.notices),
        diagnostics={
            **estimate.poses.diagnostics,
            "requested": params.estimator,
            "sensors": used,
            "possible": choice.possible,
        },
    )
    return replace(estimate, poses=poses)


@dataclass(frozen=True, eq=False)
class _Take:
    """The arguments of `estimate_poses`, with failed sensors removed from the orientations."""

    mounted: MountedSensors
    orientations: Orientations
    contacts: Mapping[Side, Bools]
    params: PoseParams

    @property
    def calibrated(self) -> CalibratedRecording:
        return self.mounted.calibrated

    @property
    def body(self) -> BodyModel:
        return self.mounted.body

    def run(self, estimator: Estimator, segments: tuple[Segment, ...]) -> PoseEstimate:
        if estimator == ERKF.name:
            return self.chain(segments)
        if estimator == ORIENTATIONS_ONLY.name:
            return self.anchored()
        poses = l7s_poses(
            self.orientations,
            free_acceleration(self.calibrated, self.orientations),
            self.steps(),
            self.body,
            self.params.l7s,
            "3I" if estimator == L7S_3I.name else "2I",
        )
        notices = (*poses.notices, *l7s_notices(self.calibrated.recording.protocol))
        poses = replace(poses, health=l7s_health(poses), notices=notices)
        return PoseEstimate(self.orientations, poses, None)

    def chain(self, segments: tuple[Segment, ...]) -> PoseEstimate:
        """Run the ErKF and its smoother."""
        if self.mounted.failure is not None:
            raise self.mounted.failure

        def forget() -> None:
            for q in (self.orientations.q, self.mounted.orientations.q):
                if isinstance(q, LastReading):
                    q.forget(segments)
            give_memory_back()

        run = run_erkf(
            self.calibrated,
            self.orientations,
            self.body,
            segments,
            self.params.erkf,
            self.mounted.arms,
            forget,
        )
        health, turned = erkf_health(run), self.mounted.turned_rad
        tracks = find_segment_tracks(run, in_place=True)
        run = run.forget_track()
        orientations = replace_orientations(run, self.orientations, tracks)
        poses = place_figure(run, orientations, self.contacts, self.body, tracks)
        poses = replace(
            poses,
            health=(*health, *judge_turned_axes(turned)),
            notices=(
                *poses.notices,
                *erkf_notices(run, health),
                *report_turned_axes(turned),
                *(() if self.mounted.arms is None else report_ahead(self.mounted.arms)),
            ),
            diagnostics={"heading_error_rad": turned},
        )
        return PoseEstimate(orientations, poses, foot_tracks(run, orientations, self.body, tracks))

    def anchored(self) -> PoseEstimate:
        """Unchanged orientations with poses by forward kinematics."""
        poses = forward_kinematics(self.orientations, self.body, self.contacts, self.params.anchor)
        return PoseEstimate(self.orientations, poses, None)

    def steps(self) -> dict[Side, Bools]:
        """Samples with each foot still."""
        still: dict[Side, Bools] = {}
        for side in SIDES:
            acc, gyr, valid = correct_signals(self.calibrated, (FOOT[side],))
            rate = self.calibrated.recording.rate_hz
            still[side], _ = contact_samples(acc[:, 0], gyr[:, 0], valid[:, 0], rate)
        return still

    def with_feet(self, estimate: PoseEstimate, segments: tuple[Segment, ...]) -> PoseEstimate:
        """The same with a separate ErKF for each foot; unchanged without feet.

        Raises
        ------
        EstimationError as `run_erkf`.
        """
        feet = tuple(FOOT[s] for s in SIDES if FOOT[s] in segments)
        if not feet:
            return estimate
        run = run_erkf(self.calibrated, self.orientations, self.body, feet, self.params.erkf)
        health = tuple(f for f in erkf_health(run) if f.of in feet)
        existing = {(f.name, f.of) for f in estimate.poses.health}
        poses = replace(
            estimate.poses,
            health=(*estimate.poses.health, *(f for f in health if (f.name, f.of) not in existing)),
            notices=(*estimate.poses.notices, *erkf_notices(run, health)),
        )
        tracks = find_segment_tracks(run, in_place=True)
        paths = foot_tracks(run, replace_orientations(run, self.orientations, tracks), self.body, tracks)
        paths = replace(
            paths,
            p={side: lay_aside(p) for side, p in paths.p.items()},
            q={side: lay_aside(q) for side, q in paths.q.items()},
            posture=self.calibrated.calibration.posture,
        )
        return replace(estimate, poses=poses, feet=paths)


def _without(orientations: Orientations, failed: Collection[Segment]) -> Orientations:
    segments = [s for s in orientations.q if s not in failed]
    q = {s: orientations.q[s] for s in segments}
    return replace(
        orientations,
        q=LastReading(q) if isinstance(orientations.q, LastReading) else q,
        valid={s: orientations.valid[s] for s in segments},
    )


def compile_pose_kernels() -> None:
    """Compile all pose kernels or load them from the cache, so that the first recording is not delayed."""
    compile_erkf_kernels()
    compile_l7s_kernel()


def compile_erkf_kernels() -> None:
    """The same for the ErKF and its smoother."""
    tree = person_tree(BodyModel.from_height(NOMINAL_HEIGHT_M), {"foot_r": np.eye(3)}, ("foot_r",))
    acc, gyr = np.tile([0.0, GRAVITY, 0.0], (2, 1, 1)), np.zeros((2, 1, 3))
    inputs = erkf_inputs(tree, acc, gyr, np.ones((2, 1), bool), 100.0)
    smooth(start_state(tree, inputs, ErkfParams()), inputs, tree, ErkfParams())
