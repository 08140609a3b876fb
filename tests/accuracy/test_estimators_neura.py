"""The constrained estimators on neura_walk, from the sensors alone, scored as test_neura_walk.py does.

Nothing was fitted here; the presets are those of spec/real-data.md §2.9, which were found on this recording.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np

from core.angles import joint_angles
from core.body import BodyModel
from core.body.erkf import ErkfParams, ErkfTrack, erkf_inputs
from core.body.erkf_start import start_state
from core.body.l7s import free_acceleration, l7s_poses
from core.body.l7s_filter import Worn
from core.body.smoother import smooth
from core.body.still import FOOT_STILL, still_samples
from core.body.tree import PRESETS, ImuTree, person_tree
from core.calibration import calibrate
from core.calibration.result import CalibratedRecording
from core.frames import FOOT, GRAVITY, SIDES, SUFFIX, Bools, Floats, Segment, Side
from core.fusion import estimate
from core.fusion.orientations import Orientations
from core.rotation import from_matrix, multiply
from tests.accuracy.report import record
from tests.accuracy.test_neura_walk import scores
from tests.data import data_folder
from tests.walks import neura_walk

HEIGHT_M = 1.70
SEGMENTS = PRESETS["lower_body7"]
FLEXION = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")

# spec/real-data.md §7, offset removed, right and left
ERKF_LIMIT = {"hip_flexion": (2.8, 3.7), "knee_flexion": (3.3, 4.8), "ankle_dorsiflexion": (2.7, 2.7)}
# the same section, mean of the sides: RMSE and r
L7S_LIMIT = {"3I": ((9.0, 12.5, 8.5), (0.83, 0.75, 0.60)), "2I": ((12.0, 13.0, 8.5), (0.70, 0.78, 0.70))}
STRAIGHT_TURN_S = (14.4, 16.2)


@cache
def calibrated() -> tuple[CalibratedRecording, Orientations]:
    take = calibrate(neura_walk())
    return take, estimate(take)


def raw_degrees(q: dict[Segment, Floats]) -> dict[str, Floats]:
    """Raw (not zeroed) angles by name in degrees."""
    take, orientations = calibrated()
    n = len(orientations.t_s)
    posed = Orientations(orientations.t_s, 100.0, q, {s: np.ones(n, bool) for s in q}, "")
    angles = joint_angles(posed, take.calibration.zero)
    return {name: np.degrees(x + angles.zero_offset[name]) for name, x in angles.angles.items()}


@cache
def erkf() -> tuple[ImuTree, ErkfTrack]:
    """Offline ErKF and smoother with nominal sensor places."""
    take, orientations = calibrated()
    mounted = take.calibration.segments
    tree = person_tree(
        BodyModel.from_height(HEIGHT_M), {s: mounted[s].R_segment_sensor for s in SEGMENTS}, SEGMENTS
    )
    acc, gyr, q = [], [], []
    for s in SEGMENTS:
        signals, mount = take.recording.sensors[s], mounted[s].R_segment_sensor
        acc.append(signals.acc - (mounted[s].rest_norm - GRAVITY) * mount[1])
        gyr.append(signals.gyr - mounted[s].gyro_bias)
        q.append(multiply(orientations.q[s][0], from_matrix(mount)))
    valid = np.stack([take.recording.sensors[s].valid for s in SEGMENTS], axis=1)
    inputs = erkf_inputs(tree, np.stack(acc, 1), np.stack(gyr, 1), valid, take.recording.rate_hz)
    params = ErkfParams.offline()
    first = start_state(tree, inputs, params, (0, 100), q=np.array(q))
    return tree, smooth(first, inputs, tree, params)[0]


def stride_errors_m(side: Side, ankle: Floats) -> Floats:
    """Estimated minus Vicon length of the straight strides of one foot, between its reviewed still phases."""
    folder = data_folder("neura_walk")
    (flags_file,) = (folder / "rawstep-detect").glob("*.csv")
    flags = np.genfromtxt(flags_file, delimiter=",", names=True)[f"step{side[0].upper()}"]
    table = np.genfromtxt(folder / "reference_angles.csv", delimiter=",", names=True)
    e = SUFFIX[side]
    true = np.stack([table[f"ankle_x_{e}_m"], table[f"ankle_y_{e}_m"]], axis=1)
    edges = np.diff(np.concatenate(([0], flags.astype(int), [0])))
    middles = [
        (a + b) // 2 for a, b in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True)
    ]
    errors = []
    for a, b in pairwise(middles):
        length = np.linalg.norm(true[b] - true[a])
        turning = a / 100 < STRAIGHT_TURN_S[1] and b / 100 > STRAIGHT_TURN_S[0]
        if a > 1000 and length > 0.3 and not turning:
            errors.append(np.linalg.norm((ankle[b] - ankle[a])[:2]) - length)
    return np.array(errors)


def test_the_erkf_with_smoother_is_within_the_limits() -> None:
    tree, track = erkf()
    lag, found = scores(raw_degrees({s: tree.segment_q(track.q)[:, i] for i, s in enumerate(SEGMENTS)}))
    rows = []
    for name, limits in ERKF_LIMIT.items():
        right, left = found[f"{name}_r"], found[f"{name}_l"]
        rows.append(
            [
                name.replace("_", " "), f"{right.offset_removed:.1f}/{left.offset_removed:.1f}",
                "/".join(f"{x:.1f}" for x in limits), f"{right.r:.3f}/{left.r:.3f}",
            ]
        )  # fmt: skip
    origin = tree.segment_origin(track.p, track.q)
    strides = {s: stride_errors_m(s, origin[:, SEGMENTS.index(FOOT[s])]) * 100 for s in SIDES}
    residual = np.sqrt(np.mean(track.joint_residual[1110:2080] ** 2, axis=0)) * 1000
    lengths = ", ".join(f"{s} {e.mean():+.1f} ± {e.std():.1f} cm (n={len(e)})" for s, e in strides.items())
    record(
        "ErKF and smoother on neura_walk",
        ["angle, right/left", "RMSE offset removed °", "limit °", "r"],
        rows,
        f"Seven sensors, nominal places, height {HEIGHT_M} m, lag {lag * 10} ms. Straight strides against "
        f"Vicon: {lengths}; limit 2.5 ± 1.5 cm. Joint-centre residual {residual.min():.0f} to "
        f"{residual.max():.0f} mm, {int(track.refused.sum())} zero velocities refused.",
    )
    for name, limits in ERKF_LIMIT.items():
        for end, limit in zip("rl", limits, strict=True):
            assert found[f"{name}_{end}"].offset_removed <= limit, f"{name} {end}"
    for errors in strides.values():
        assert len(errors) >= 2
        assert abs(errors.mean()) <= 2.5
        assert errors.std() <= 1.5
    assert residual.max() <= 30.0


def test_l7s_from_three_and_two_sensors_is_within_the_limits() -> None:
    take, orientations = calibrated()
    steps: dict[Side, Bools] = {}
    for side in SIDES:
        signals = take.recording.sensors[FOOT[side]]
        gyr = signals.gyr - take.calibration.segments[FOOT[side]].gyro_bias
        steps[side] = still_samples(signals.acc, gyr, signals.valid, 100.0, FOOT_STILL)
    acceleration = free_acceleration(take, orientations)
    rows: list[list[str]] = []
    kept: dict[str, list[tuple[float, float]]] = {}
    worn: Worn
    for worn in ("3I", "2I"):
        poses = l7s_poses(orientations, acceleration, steps, BodyModel.from_height(HEIGHT_M), worn=worn)
        _, found = scores(raw_degrees(dict(poses.q)))
        figures = [
            (
                float(np.mean([found[f"{n}_{e}"].offset_removed for e in "rl"])),
                float(np.mean([found[f"{n}_{e}"].r for e in "rl"])),
            )
            for n in FLEXION
        ]
        kept[worn] = figures
        rows.append([f"L7S-{worn}", *(f"{rmse:.1f} / {r:.2f}" for rmse, r in figures)])
    rows.append(["Sy 2021 Table V, 3I", "5.0 / .95", "8.2 / .91", "5.9 / .78"])
    rows.append(["Sy 2021 Table V, 2I", "6.9 / –", "9.5 / –", "7.5 / –"])
    record(
        "L7S on neura_walk",
        ["run", "hip flexion RMSE ° / r", "knee", "ankle"],
        rows,
        "Mean of both sides, offset removed, whole walk with its turn; the paper's figures are of nine "
        "people, per step of straight walking. A sparse mode: do not take stride lengths from it.",
    )
    for mode, (rmse_limits, r_limits) in L7S_LIMIT.items():
        for (rmse, r), rmse_limit, r_limit in zip(kept[mode], rmse_limits, r_limits, strict=True):
            assert rmse <= rmse_limit, mode
            assert r >= r_limit, mode
