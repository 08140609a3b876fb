"""Gain from estimated sensor positions and joint centres: simulated skin against truth, and real people.

Unit tests (`test_arms.py`) cover the arms; here their effect on the ErKF is measured.
"""

from __future__ import annotations

from functools import cache
from statistics import fmean

import numpy as np

from sagittal.core.angles.measure import measure_angles
from sagittal.core.body.arms import MeasuredArms
from sagittal.core.body.erkf.poses import ErkfRun, foot_tracks, replace_orientations, run_erkf
from sagittal.core.body.mounting import MountedSensors
from sagittal.core.body.tree import PRESETS
from sagittal.core.frames import FOOT, SHANK, SIDES, Bools, Floats
from sagittal.core.rotation import wrap_angle
from sagittal.core.signals.rest import index_window
from sagittal.core.simulate import WalkTruth, simulate_scenario
from tests.helpers.neura import SHIPPED, Chain, chain, take
from tests.helpers.neura_angles import scores
from tests.helpers.walks import analysed
from validation.accuracy.test_setup_mistakes import analyse_right
from validation.figures import record
from validation.marks import whole_only

PEOPLE = (("slow", 1), ("hemiparetic", 7), ("crouch", 7))
ANGLES = (
    "hip_flexion", "knee_flexion", "ankle_dorsiflexion", "hip_adduction", "knee_adduction", "ankle_inversion",
)  # fmt: skip
WHOLE = PRESETS["lower_body7"]
FLAT_S = 0.22
"""From an initial contact to the middle of flat foot."""


def filter_take(mounted: MountedSensors, arms: MeasuredArms | None) -> ErkfRun:
    return run_erkf(mounted.calibrated, mounted.orientations, mounted.body, WHOLE, SHIPPED, arms)


def while_walking(mounted: MountedSensors, n: int) -> Bools:
    walked = np.zeros(n, np.bool_)
    for window in mounted.calibrated.calibration.walking:
        walked[index_window(window, mounted.calibrated.recording.rate_hz)] = True
    return walked


def score_people(mounted: MountedSensors, run: ErkfRun, truth: WalkTruth) -> tuple[list[float], float]:
    """RMS error in degrees of every angle while walking, both sides, and the bias of stride lengths in cm."""
    orientations = replace_orientations(run, mounted.orientations)
    angles = measure_angles(orientations, mounted.calibrated.calibration.zero).angles
    true, n = truth.subtract_standing(), min(len(run.track.q), len(truth.t_s))
    walked = while_walking(mounted, n)
    errors = []
    for name in ANGLES:
        off = [wrap_angle(angles[f"{name}_{s}"][:n] - true[f"{name}_{s}"][:n])[walked] for s in "rl"]
        errors.append(float(np.degrees(np.sqrt(np.nanmean(np.square(off))))))
    feet, strides = foot_tracks(run, orientations, mounted.body), []
    for stride in truth.strides:
        a, b = (round((t + FLAT_S) * truth.rate_hz) for t in (stride.start_s, stride.end_s))
        if b < n:
            ours, theirs = feet.p[stride.side], truth.p[FOOT[stride.side]]
            strides.append(_way(ours, a, b) - _way(theirs, a, b))
    return errors, 100.0 * fmean(strides)


def _way(p: Floats, a: int, b: int) -> float:
    return float(np.linalg.norm((p[b] - p[a])[:2]))


@cache
def simulated_scores() -> dict[str, tuple[tuple[list[float], float], ...]]:
    """Person → scores with nominal arms and with measured ones."""
    result = {}
    for name, seed in PEOPLE:
        mounted, truth = analysed(name, seed).mounted, simulate_scenario(name, seed).truth
        assert mounted is not None
        assert mounted.arms is not None
        runs = (filter_take(mounted, arms) for arms in (None, mounted.arms))
        result[name] = tuple(score_people(mounted, run, truth) for run in runs)
    return result


@cache
def real_chains() -> tuple[Chain, Chain]:
    """neura_walk with nominal arms and with measured ones."""
    return chain(*take(), measured=False), chain(*take())


@whole_only
def test_write_down_what_arms_from_motion_gain() -> None:
    rows = []
    for name, (usual, ours) in simulated_scores().items():
        cells = [f"{a:.2f} → {b:.2f}" for a, b in zip(usual[0], ours[0], strict=True)]
        rows.append([name, *cells, f"{usual[1]:+.1f} → {ours[1]:+.1f}"])
    pair_of = [scores(x.angles_deg)[1] for x in real_chains()]
    cells = []
    for name in ANGLES:
        pair = ["/".join(f"{x[f'{name}_{s}'].offset_removed:.1f}" for s in "rl") for x in pair_of]
        cells.append(" → ".join(pair))
    ways = ["/".join(f"{x.strides_cm()[s].mean():+.1f}" for s in reversed(SIDES)) for x in real_chains()]
    rows.append(["neura_walk, right/left", *cells, " → ".join(ways)])
    record(
        "Places and centres from motion",
        ["person", *(n.replace("_", " ") + " °" for n in ANGLES), "bias of strides cm"],
        rows,
        "ErKF and smoother with nominal places → with those from motion. Simulated people on skin with "
        "sensors off their nominal places: RMS while walking, both sides; neura_walk: offset removed, "
        f"against Vicon. {_say_joints()} Limits: no flexion of simulated people worse by 0.05°, no other "
        "angle by 0.15°, bias of strides within 1.5 cm; no angle of neura_walk worse by 0.15°.",
    )
    for usual, ours in simulated_scores().values():
        worse = np.array(ours[0]) - np.array(usual[0])
        assert worse[:3].max() < 0.05
        assert worse.max() < 0.15
        assert abs(ours[1]) < 1.5
    bias = [float(np.sqrt(np.mean([x[k][1] ** 2 for x in simulated_scores().values()]))) for k in (0, 1)]
    assert bias[1] < 0.7 * bias[0]
    for key in (f"{name}_{s}" for name in ANGLES for s in "rl"):
        assert pair_of[1][key].offset_removed < pair_of[0][key].offset_removed + 0.15, key


def ends_apart_mm(mounted: MountedSensors, arms: MeasuredArms | None) -> float:
    """RMS distance of the two ends of all joints while walking."""
    track = filter_take(mounted, arms).track
    walked = while_walking(mounted, len(track.q))
    return float(1000.0 * np.sqrt(np.mean(track.joint_residual[walked] ** 2)))


def _say_joints() -> str:
    mounted = analyse_right("qmt_fullbody").mounted
    assert mounted is not None
    a, b = (ends_apart_mm(mounted, arms) for arms in (None, mounted.arms))
    assert b < a
    return f"Ends of joints of qmt_fullbody: {a:.0f} → {b:.0f} mm apart."


def test_left_and_right_sit_alike_on_real_people() -> None:
    """Nothing ties both legs together: who was fitted alike on both sides must come out alike."""
    mounted = analyse_right("qmt_fullbody").mounted
    assert mounted is not None
    assert mounted.arms is not None
    for pair in (SHANK, FOOT):
        a, b = (mounted.arms.sensors[pair[s]] for s in ("right", "left"))
        apart = np.abs((a.place - b.place * [1, 1, -1])[:2])
        assert (apart < 3.0 * np.hypot(a.sd, b.sd)[:2]).all(), pair
