"""A calibrated recording through the ErKF and its smoother: orientations, poses and paths of the feet."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from sagittal.core.body.arms import MeasuredArms
from sagittal.core.body.corrected import SIGNALS, CorrectedSignals, correct_signals
from sagittal.core.body.erkf.filter import (
    ErkfInputs,
    ErkfState,
    ErkfTrack,
    TakeInputs,
    erkf_inputs,
    find_rests,
)
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.erkf.smoother import do_nothing, smooth
from sagittal.core.body.erkf.start import start_state
from sagittal.core.body.feet import FootTracks
from sagittal.core.body.kinematics import incomplete_legs
from sagittal.core.body.model import BodyModel
from sagittal.core.body.places import joint_places, sensor_place
from sagittal.core.body.poses import Poses, figure_precision
from sagittal.core.body.tree import ImuTree, person_tree
from sagittal.core.estimators import ERKF, LINKED_PATHS, SINGLE_PATHS
from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Bools, Floats, Segment, Side
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import from_matrix, multiply, rotate
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.held_samples import cut_blocks
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import find_runs

NEAR_START_S = 1.0
"""Rest that begins so early is a standing start."""


@dataclass(frozen=True, eq=False)
class ErkfRun:
    """One smoothed run.

    Parameters
    ----------
    inputs : without signals and rolling, which are not needed after filtering. rest : samples of initial
        standing, None = the recording starts mid-walk.
    """

    tree: ImuTree
    inputs: ErkfInputs
    start: ErkfState
    rest: tuple[int, int] | None
    track: ErkfTrack
    final: ErkfState

    @property
    def segments(self) -> tuple[Segment, ...]:
        """Segments in the tree's order."""
        return cast("tuple[Segment, ...]", self.tree.imus)

    def forget_track(self) -> ErkfRun:
        """The run without its track, once segments and health have been extracted."""
        none = np.empty((0, len(self.tree.imus)))
        joints, refused = np.empty((0, len(self.tree.joints))), none.astype(np.bool_)
        return replace(self, track=ErkfTrack((), (), none, joints, refused, np.empty((0, 0, 16))))


def run_erkf(
    calibrated: CalibratedRecording,
    orientations: Orientations,
    body: BodyModel,
    segments: Sequence[Segment],
    params: ErkfParams,
    arms: MeasuredArms | None = None,
    filtered: Callable[[], None] = do_nothing,
) -> ErkfRun:
    """Filter and smooth a recording with the sensors of some segments; neighbours are linked, others run
    independently.

    Parameters
    ----------
    arms : sensor positions and joint centres; None = nominal. filtered : called after the last use of the
        orientations, when no more errors can occur.

    Raises
    ------
    EstimationError as `person_tree` and `smooth`.
    """
    mounts = {s: calibrated.calibration.segments[s].R_segment_sensor for s in segments}
    tree = person_tree(
        body, mounts, segments, None if arms is None else arms.places, None if arms is None else arms.centres
    )
    rate = calibrated.recording.rate_hz
    inputs = _find_inputs(tree, calibrated, segments, params)
    first = np.stack([multiply(orientations.q[s][0], from_matrix(mounts[s])) for s in segments])
    standing = next(
        (
            (round(a * rate), round(b * rate))
            for a, b in calibrated.calibration.rest
            if a <= NEAR_START_S and b - a >= NEAR_START_S
        ),
        None,
    )
    # without a standing start the biases still come from the calibration's rest, wherever that is
    age_s = calibrated.calibration.zero[0] if calibrated.calibration.posture == "standing" else None
    # orientations are known: of the signals it takes the first sample
    start = start_state(tree, inputs.part(0, 1), params, standing, q=first, bias_age_s=age_s)
    track, final = smooth(start, inputs, tree, params, filtered=filtered)
    return ErkfRun(tree, replace(inputs.known, rolling=None), start, standing, track, final)


def _find_inputs(
    tree: ImuTree, calibrated: CalibratedRecording, segments: Sequence[Segment], params: ErkfParams
) -> TakeInputs:
    """The filter inputs of a recording; signals bridged across lost samples are stored, all others
    computed on demand.
    """
    recording = calibrated.recording
    valid = np.stack([recording.sensors[s].valid for s in segments], axis=1)
    patched = find_patches(recording, segments, params.patch_s)
    if not valid.all():
        whole = erkf_inputs(tree, *correct_signals(calibrated, segments), recording.rate_hz)
        none = whole.acc[:0]
        return TakeInputs(replace(whole, acc=none, gyr=none, patched=patched), whole.acc, whole.gyr)

    def of_sensor(i: int) -> tuple[Floats, Floats]:
        acc, gyr = (CorrectedSignals(calibrated, segments[i : i + 1], name)[:] for name in SIGNALS)
        return acc[:, 0], gyr[:, 0]

    acc, gyr = (CorrectedSignals(calibrated, segments, name) for name in SIGNALS)
    inputs = find_rests(tree, of_sensor, valid, recording.rate_hz)
    return TakeInputs(replace(inputs, patched=patched), acc, gyr)


def find_patches(recording: UniformRecording, segments: Sequence[Segment], longest_s: float) -> Bools:
    """Samples (T, n) interpolated across gaps longer than `longest_s` between the adjacent samples."""
    patched = np.zeros((len(recording.t_s), len(segments)), np.bool_)
    for i, segment in enumerate(segments):
        for start, stop in find_runs(recording.sensors[segment].interpolated):
            patched[start:stop, i] = (stop - start + 1) / recording.rate_hz > longest_s
    return patched


@dataclass(frozen=True, eq=False)
class SegmentTracks:
    """Trajectories of the segments of a run; q, p : segment → orientation (T, 4) and origin (T, 3) m, in
    W.
    """

    q: Mapping[Segment, Floats]
    p: Mapping[Segment, Floats]


def find_segment_tracks(run: ErkfRun, *, in_place: bool = False) -> SegmentTracks:
    """Segment trajectories from the smoothed sensors of a run.

    Parameters
    ----------
    in_place : overwrite `run.track`, which must not be used afterwards: saves 144 MB for an hour of seven
        sensors.
    """
    q, p = {}, {}
    for i, segment in enumerate(run.segments):
        place, turn = run.track.places[i], run.track.turns[i]
        if not in_place:
            q[segment], p[segment] = run.tree.segment(i, place, turn)
            continue
        for part in cut_blocks(len(place)):
            turn[part], place[part] = run.tree.segment(i, place[part], turn[part])
        q[segment], p[segment] = turn, place
    return SegmentTracks(q, p)


def replace_orientations(
    run: ErkfRun, orientations: Orientations, tracks: SegmentTracks | None = None
) -> Orientations:
    """The given orientations with those of the run's segments replaced."""
    orientations_by_segment = (tracks or find_segment_tracks(run)).q
    return replace(orientations, q={**orientations.q, **orientations_by_segment}, engine=ERKF.method)


def place_figure(
    run: ErkfRun,
    orientations: Orientations,
    contacts: Mapping[Side, Bools],
    body: BodyModel,
    tracks: SegmentTracks,
) -> Poses:
    """Position the pelvis and every complete leg in W.

    Heights are levelled: between the rests of a foot, the deviation of its ankle from the nominal height
    above the floor is subtracted, so that a flat floor stays at z = 0; stairs are not represented. Segments
    have the lengths of the body model, regardless of estimated joint centres.

    Parameters
    ----------
    orientations : as refined by this run.
    """
    legs = [s for s in SIDES if {THIGH[s], SHANK[s], FOOT[s]} <= set(run.segments)]
    displayed: list[Segment] = ["pelvis", *(x for s in legs for x in (THIGH[s], SHANK[s], FOOT[s]))]
    still = {s: run.inputs.contact[:, run.segments.index(FOOT[s])] for s in legs}
    floor = _floor({s: tracks.p[FOOT[s]][:, 2] - body.ankle_height for s in legs}, still)
    level = {s: np.empty((len(floor), 3), figure_precision(len(floor))) for s in displayed}
    for part in cut_blocks(len(floor)):
        place = {s: tracks.p[s][part] for s in displayed}
        turned = {s: orientations.q[s][part] for s in displayed}
        for side in legs:
            place |= _hang_together(run, turned, place, side, body)
        for s, p in place.items():
            level[s][part] = p
            level[s][part, 2] = p[:, 2] - floor[part]
    return Poses(
        t_s=orientations.t_s,
        rate_hz=orientations.rate_hz,
        q={s: orientations.q[s] for s in displayed},
        p=level,
        valid=np.logical_and.reduce([orientations.valid[s] for s in displayed]),
        contact={FOOT[s]: contacts.get(s, still[s]) for s in legs},
        body=body,
        method=ERKF.method,
        notices=incomplete_legs(orientations, legs),
    )


def foot_tracks(
    run: ErkfRun, orientations: Orientations, body: BodyModel, tracks: SegmentTracks | None = None
) -> FootTracks:
    """Paths of the run's feet; linked if both are connected to the same pelvis.

    Parameters
    ----------
    orientations : as refined by this run.
    """
    columns: dict[Side, int] = {s: run.segments.index(FOOT[s]) for s in SIDES if FOOT[s] in run.segments}
    patched, paths = run.inputs.patched, (tracks or find_segment_tracks(run)).p
    linked = len(columns) == 2 and not (
        {FOOT[s] for s in columns} & {run.segments[i] for i in run.tree.roots()}
    )
    return FootTracks(
        t_s=orientations.t_s,
        rate_hz=orientations.rate_hz,
        p={s: paths[FOOT[s]] for s in columns},
        q={s: orientations.q[FOOT[s]] for s in columns},
        still={s: run.inputs.contact[:, i] for s, i in columns.items()},
        valid={s: orientations.valid[FOOT[s]] for s in columns},
        patched={}
        if patched is None
        else {s: patched[:, i] & ~run.inputs.contact[:, i] for s, i in columns.items()},
        sensor_ahead={
            s: float(run.tree.place[i, 0] - sensor_place(FOOT[s], body)[0]) for s, i in columns.items()
        },
        linked=linked,
        source=LINKED_PATHS if linked else SINGLE_PATHS,
        body=body,
    )


def _hang_together(
    run: ErkfRun,
    turned: Mapping[Segment, Floats],
    place: Mapping[Segment, Floats],
    side: Side,
    body: BodyModel,
) -> dict[Segment, Floats]:
    """Origins (n, 3) of shank and thigh for a body with the nominal lengths.

    With estimated joint centres, nominal segments do not end exactly at their joints. From the foot up each
    is shifted to meet the next; the remaining gap is at the hip, where it is not visible.
    """
    nominal = joint_places(body)
    joints = {(run.segments[j.proximal], run.segments[j.distal]): j for j in run.tree.joints}
    moved, shift = {}, np.zeros(3)
    for upper, lower in ((SHANK[side], FOOT[side]), (THIGH[side], SHANK[side])):
        joint = joints[upper, lower]
        used = rotate(run.tree.q_mount[joint.proximal], joint.r_proximal) + run.tree.place[joint.proximal]
        shift = shift + rotate(turned[upper], used - nominal[upper, lower][0])
        moved[upper] = place[upper] + shift
    return moved


def _floor(ankle_heights: Mapping[Side, Floats], still: Mapping[Side, Bools]) -> Floats:
    """Height (n,) of the floor estimated by the run: that of the feet at rest, linear in between."""
    n = len(next(iter(ankle_heights.values())))
    heights = np.zeros(n)
    count = np.zeros(n)
    for side, height in ankle_heights.items():
        heights += np.where(still[side], height, 0.0)
        count += still[side]
    index = np.flatnonzero(count)
    if not len(index):
        return np.zeros(n)
    return np.interp(np.arange(n), index, heights[index] / count[index])
