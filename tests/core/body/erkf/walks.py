"""Runs of the ErKF that tests share: a simulated person with known mounts, and what its track says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from math import pi

import numpy as np

from sagittal.core.angles.measure import measure_angles
from sagittal.core.body.erkf.filter import ErkfInputs, ErkfTrack, erkf_inputs, filter_block
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.erkf.smoother import smooth
from sagittal.core.body.erkf.start import start_state
from sagittal.core.body.tree import PRESETS, ImuTree, person_tree
from sagittal.core.frames import FOOT, GRAVITY, Floats, Segment
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import to_matrix
from sagittal.core.simulate import (
    Arc,
    Pivot,
    RecordingSetup,
    Simulation,
    Stand,
    Straight,
    WalkTruth,
    simulate,
)
from sagittal.core.timeline import synchronise

MIXED = (
    Stand(6.0), Straight(12.8, 0.64, 0.54), Arc(1.5, pi, 0.52, 0.56), Straight(12.8, 0.64, 0.54),
    Pivot(-pi, 0.7, 0.55), Straight(12.8, 0.64, 0.54), Stand(4.0),
)  # fmt: skip
SEGMENTS = PRESETS["lower_body7"]


@dataclass(frozen=True, eq=False)
class Take:
    """A simulated recording as the filter sees it, and the truth."""

    tree: ImuTree
    inputs: ErkfInputs
    truth: WalkTruth
    rate_hz: float

    @property
    def rest(self) -> tuple[int, int]:
        """Samples of the first standing."""
        a, b = (round(t * self.rate_hz) for t in self.truth.zero)
        return a, b


@cache
def mixed_walk(seed: int = 2) -> Take:
    """About a minute with an arc, a pivot and MEMS noise; mounts, places and gyro bias at rest are known."""
    return take_of(simulate(MIXED, seed=seed, setup=RecordingSetup()))


def take_of(result: Simulation) -> Take:
    """Inputs with the true mounts and places; gyroscope bias from the first standing."""
    recording, truth = synchronise(result.recording), result.truth
    mounts = {s: to_matrix(truth.mounts[s].q_segment_sensor) for s in SEGMENTS}
    places = {s: truth.mounts[s].position_m for s in SEGMENTS}
    tree = person_tree(truth.body, mounts, SEGMENTS, places)
    window = slice(*(round(t * recording.rate_hz) for t in truth.zero))
    acc, gyr = [], []
    for s in SEGMENTS:
        signals = recording.sensors[s]
        up = signals.acc[window].mean(axis=0)
        norm = np.linalg.norm(up)
        acc.append(signals.acc - (norm - GRAVITY) * up / norm)
        gyr.append(signals.gyr - signals.gyr[window].mean(axis=0))
    valid = np.stack([recording.sensors[s].valid for s in SEGMENTS], axis=1)
    inputs = erkf_inputs(tree, np.stack(acc, axis=1), np.stack(gyr, axis=1), valid, recording.rate_hz)
    return Take(tree, inputs, truth, recording.rate_hz)


def filtered(take: Take, params: ErkfParams) -> ErkfTrack:
    """The filter over the whole take, from its standing start."""
    first = start_state(take.tree, take.inputs, params, take.rest)
    return filter_block(first, take.inputs, take.tree, params)[0]


def smoothed(take: Take, params: ErkfParams) -> ErkfTrack:
    """The same through the smoother."""
    first = start_state(take.tree, take.inputs, params, take.rest)
    return smooth(first, take.inputs, take.tree, params)[0]


def angles_of(take: Take, track: ErkfTrack, *, zeroed: bool = True) -> dict[str, Floats]:
    """Joint angles (n,) in rad by name, zeroed on the first standing or as they are."""
    q = {s: take.tree.segment_q(track.q)[:, i] for i, s in enumerate(SEGMENTS)}
    n = len(track.q)
    posed = Orientations(take.truth.t_s[:n], take.rate_hz, q, {s: np.ones(n, bool) for s in q}, "erkf")
    angles = measure_angles(posed, take.truth.zero)
    return {n: x + (0.0 if zeroed else angles.zero_offset[n]) for n, x in angles.angles.items()}


def angle_errors_deg(take: Take, track: ErkfTrack) -> dict[str, float]:
    """RMS error of each angle in degrees."""
    true, angles = take.truth.subtract_standing(), angles_of(take, track)
    return {n: float(np.degrees(np.sqrt(np.mean((a - true[n][: len(a)]) ** 2)))) for n, a in angles.items()}


def stride_errors_m(take: Take, track: ErkfTrack) -> Floats:
    """Estimated minus true stride length of every stride, ankle to ankle in the middle of flat foot."""
    origin = take.tree.segment_origin(track.p, track.q)
    errors = []
    for stride in take.truth.strides:
        i = SEGMENTS.index(FOOT[stride.side])
        ends = [round((t + 0.22) * take.rate_hz) for t in (stride.start_s, stride.end_s)]
        if ends[1] < len(origin):
            errors.append(np.linalg.norm((origin[ends[1], i] - origin[ends[0], i])[:2]) - stride.length_m)
    return np.array(errors)


def lost(take: Take, segment: Segment, start_s: float, stop_s: float) -> Take:
    """The same take with one sensor lost for a while; its last sample is held."""
    i = take.tree.imus.index(segment)
    a, b = round(start_s * take.rate_hz), round(stop_s * take.rate_hz)
    acc, gyr = take.inputs.acc.copy(), take.inputs.gyr.copy()
    valid, contact, still = take.inputs.valid.copy(), take.inputs.contact.copy(), take.inputs.still.copy()
    acc[a:b, i], gyr[a:b, i] = acc[a - 1, i], gyr[a - 1, i]
    valid[a:b, i] = contact[a:b, i] = still[a:b, i] = False
    inputs = replace(take.inputs, acc=acc, gyr=gyr, valid=valid, contact=contact, still=still)
    return replace(take, inputs=inputs)
