"""Tables V and IV of Sy 2021 and ours side by side, and the limits on simulation of
docs/science/l7s.md, "Limits on simulated walks".

The paper's rows are of nine and five real people against Vicon; ours are of simulated people of three heights
against exact truth, and so say how well the method is carried out, not how well it does on people: for that
see "L7S on neura_walk".
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Final, get_args

import numpy as np
import pytest

from sagittal.core.body.l7s.filter import Adjoint, L7sParams, Worn
from sagittal.core.body.l7s.inputs import free_acceleration
from sagittal.core.body.l7s.legs import BODIES
from sagittal.core.body.l7s.poses import l7s_poses
from sagittal.core.body.poses import Poses
from sagittal.core.calibration import calibrate
from sagittal.core.frames import FOOT, SHANK, SIDES, Floats, Segment, Side
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import angle_between, exp, multiply, to_matrix
from sagittal.core.simulate import RecordingSetup, simulate
from sagittal.core.simulate.script import Stand, Straight
from sagittal.core.timeline import synchronise
from tests.helpers.l7s_walks import (
    MOVEMENTS,
    PEOPLE,
    Strides,
    Trial,
    cycle_scores,
    pose_errors,
    steps_of,
    strides_of,
    trial,
    trial_scores,
    turned_headings,
)
from validation.figures import record

RUNS: Final[tuple[tuple[Worn, Adjoint], ...]] = tuple(
    (w, a) for w in get_args(Worn) for a in get_args(Adjoint)
)

# docs/science/l7s.md, "Limits on simulated walks": RMSE without offset in °, correlation of hip, knee and
# ankle flexion
RMSE_LIMIT = {"3I": (8.0, 12.0, 9.0), "2I": (12.0, 16.0, 11.0)}
R_LIMIT = {"3I": (0.85, 0.70, 0.75), "2I": (0.75, 0.60, 0.65)}
"""Those of 2I are our choice: a prototype reached .81, .65, .78."""

STRIDE_CM, DISTANCE = 4.0, 0.03
"""RMS of stride lengths; error of the whole way, a limit for 3I."""

TABLE_V = (
    ("Sy 2021, 9 people, Plug-in Gait", "3I", "5.0 ± 1.0 / .95", "8.2 ± 2.2 / .91", "5.9 ± 1.6 / .78"),
    ("Sy 2021, 9 people, kinematic fit", "3I", "5.1 ± 1.0 / .95", "8.4 ± 1.8 / .93", "5.6 ± 1.6 / .74"),
    ("Sy 2021, 9 people, Plug-in Gait", "2I", "6.9 ± 1.3 / .90", "9.5 ± 2.0 / .89", "7.5 ± 1.1 / .77"),
    ("Sy 2021, 9 people, kinematic fit", "2I", "7.3 ± 1.4 / .88", "9.0 ± 1.9 / .92", "6.7 ± 1.1 / .74"),
)

TABLE_IV = (
    ("Sy 2021, NeuRA free walk", "3I", "L", "1.9", "91", "-1.7 ± 5", "4.9", "70", "-1.2 ± 4", "3.8"),
    ("Sy 2021, NeuRA free walk", "3I", "R", "3.0", "93", "-2.8 ± 5", "6.0", "71", "-1.9 ± 4", "4.1"),
    ("Sy 2021, NeuRA free walk", "2I", "L", "3.7", "91", "-3.3 ± 5", "5.9", "70", "-2.5 ± 4", "4.7"),
    ("Sy 2021, NeuRA free walk", "2I", "R", "4.8", "93", "-4.4 ± 6", "7.1", "71", "-3.3 ± 4", "5.3"),
    ("Sy 2021, TCD walking", "3I", "L", "3.7", "117", "-4.4 ± 5", "6.7", "97", "-3.4 ± 4", "5.3"),
    ("Sy 2021, TCD walking", "3I", "R", "4.3", "115", "-4.9 ± 5", "7.2", "96", "-4.0 ± 4", "5.8"),
    ("Sy 2021, TCD walking", "2I", "L", "4.2", "117", "-5.0 ± 5", "7.2", "97", "-3.9 ± 5", "6.0"),
    ("Sy 2021, TCD walking", "2I", "R", "4.3", "115", "-5.0 ± 6", "7.5", "96", "-4.0 ± 4", "6.0"),
)


@cache
def runs(movement: str, segments: Worn, adjoint: Adjoint) -> tuple[tuple[Trial, Poses], ...]:
    """Everybody's take of a movement and what L7S makes of it."""
    takes = [trial(movement, height_m, seed) for height_m, seed in PEOPLE]
    return tuple((take, take.run(segments, adjoint)) for take in takes)


def pooled(segments: Worn, adjoint: Adjoint, side: Side) -> list[Strides]:
    return [strides_of(t, p, side) for m in MOVEMENTS for t, p in runs(m, segments, adjoint)]


@pytest.mark.parametrize(("worn", "adjoint"), RUNS)
def test_joint_angles_of_every_movement_are_within_the_limits(worn: Worn, adjoint: Adjoint) -> None:
    for movement in MOVEMENTS:
        for take, poses in runs(movement, worn, adjoint):
            scores = [cycle_scores(take, poses).mean(axis=0)]
            # the limits are of straight walking
            scores += [trial_scores(take, poses)] if movement == "walk" else []
            for result in scores:
                assert (result[:, 0] < RMSE_LIMIT[worn]).all(), movement
                assert (result[:, 1] > R_LIMIT[worn]).all(), movement


@pytest.mark.parametrize(("worn", "adjoint"), RUNS)
def test_strides_and_the_way_of_every_movement_are_within_the_limits(worn: Worn, adjoint: Adjoint) -> None:
    for side in SIDES:
        for result in pooled(worn, adjoint, side):
            errors = result.found - result.true
            assert 100.0 * np.sqrt(np.mean(errors**2)) < STRIDE_CM
            assert abs(result.distance_error) < DISTANCE


def test_table_v_is_written_down_beside_the_papers() -> None:
    rows = [[source, f"L7S-{segment_names}", *cells, "–", "–"] for source, segment_names, *cells in TABLE_V]
    rows += [
        ["Sy 2021, free walk", "L7S-3I", "–", "–", "–", "5.9 ± 1.3", "13.4 ± 1.9"],
        ["Sy 2021, free walk", "L7S-2I", "–", "–", "–", "6.4 ± 1.2", "12.7 ± 1.6"],
    ]
    for segment_names, adjoint in RUNS:
        cycles = np.concatenate([cycle_scores(t, p) for t, p in runs("walk", segment_names, adjoint)])
        rows.append(
            [
                f"ours, simulated, straight cycles of “walk”, n={len(cycles)}",
                f"L7S-{segment_names} {adjoint}",
                *(f"{a.mean():.1f} ± {a.std():.1f} / {r:.2f}" for a, r in _columns(cycles)),
                "–",
                "–",
            ]
        )
    for segment_names, adjoint in RUNS:
        whole = [x for m in MOVEMENTS for x in runs(m, segment_names, adjoint)]
        scores = np.array([trial_scores(t, p) for t, p in whole])
        apart = np.array([pose_errors(t, p) for t, p in whole])
        rows.append(
            [
                f"ours, simulated, whole takes with turns, n={len(whole)}",
                f"L7S-{segment_names} {adjoint}",
                *(f"{a.mean():.1f} ± {a.std():.1f} / {r:.2f}" for a, r in _columns(scores)),
                *(f"{e.mean():.1f} ± {e.std():.1f}" for e in apart.T),
            ]
        )
    record(
        "L7S: joint angles beside Sy 2021 Table V",
        ["source", "run", "hip flexion RMSE ° / r", "knee", "ankle", "e_pos cm", "e_ori °"],
        rows,
        "RMSE with the offset of the trial removed. The paper's rows are its own results on real people "
        "against Vicon with Vicon's start and reviewed step flags; its trial is one step, ours one gait "
        f"cycle, which is the harder. Ours: walkers of {', '.join(f'{h:g} m' for h, _ in PEOPLE)} with "
        "sensors on skin, random mounting and MEMS errors; calibration, orientations and step flags from "
        "the signals, lengths known, the truth is exact. Limits of straight walking "
        "(docs/science/l7s.md): RMSE 3I 8, 12, 9 and 2I 12, 16, 11°; r 3I .85, .70, .75.",
    )


def test_table_iv_is_written_down_beside_the_papers() -> None:
    rows = [[source, f"L7S-{segment_names}", *cells] for source, segment_names, *cells in TABLE_IV]
    for segment_names, adjoint in RUNS:
        for side in SIDES:
            takes = pooled(segment_names, adjoint, side)
            way = 100.0 * np.mean([abs(x.distance_error) for x in takes])
            true, result, lasted = (
                np.concatenate([getattr(x, name) for x in takes]) for name in ("true", "found", "duration_s")
            )
            walked = true > 0.05
            cells = [f"{way:.1f}"]
            for a, b in ((result, true), (result / lasted, true / lasted)):
                error = 100.0 * (a - b)[walked]
                cells += [f"{100.0 * b[walked].mean():.0f}", f"{error.mean():+.1f} ± {error.std():.1f}"]
                cells.append(f"{np.sqrt(np.mean(error**2)):.1f}")
            source = f"ours, simulated, n={int(walked.sum())}"
            rows.append([source, f"L7S-{segment_names} {adjoint}", side[0].upper(), *cells])
    record(
        "L7S: strides and speed beside Sy 2021 Table IV",
        [
            "source", "run", "foot", "way, mean deviation %", "stride, true cm", "error cm", "RMS cm",
            "speed, true cm/s", "error cm/s", "RMS cm/s",
        ],
        rows,
        f"Every stride of {', '.join(MOVEMENTS)}, turns included, between edges of step flags. The paper's "
        "rows are its own results on real people against Vicon; ours are simulated (as above), where feet "
        "stand exactly still and lengths are known, and so are smaller. Limits (docs/science/l7s.md): "
        f"RMS {STRIDE_CM:g} cm of a take, way {100 * DISTANCE:g} %.",
    )  # fmt: skip


def _columns(scores: Floats) -> list[tuple[Floats, float]]:
    """Per joint the RMSE of every trial, and the mean correlation."""
    return [(scores[:, i, 0], float(scores[:, i, 1].mean())) for i in range(scores.shape[1])]


@cache
def given_orientations(seed: int) -> Trial:
    """The walk of the limits: 25 m, true orientations with 1° constant and 1° drifting error."""
    take = simulate((Stand(5.0), Straight(25.0, 0.64, 0.54), Stand(3.0)), seed=seed, setup=RecordingSetup())
    recording, truth = synchronise(take.recording), take.truth
    calibrated = calibrate(recording)
    n, rng = len(recording.t_s), np.random.default_rng(seed)
    q: dict[Segment, Floats] = {}
    segments = dict(calibrated.calibration.segments)
    for segment in BODIES:
        error = np.radians(rng.standard_normal(3) + _wandering(n, 3.0, recording.rate_hz, rng))
        q[segment] = multiply(truth.q[segment][:n], exp(error))
        mount = to_matrix(truth.mounts[segment].q_segment_sensor)
        segments[segment] = replace(segments[segment], R_segment_sensor=mount)
    valid = {s: recording.sensors[s].valid for s in BODIES}
    orientations = Orientations(recording.t_s, recording.rate_hz, q, valid, "given")
    mounted = replace(calibrated, calibration=replace(calibrated.calibration, segments=segments))
    acceleration = free_acceleration(mounted, orientations)
    return Trial(mounted, orientations, acceleration, steps_of(mounted), truth)


def _wandering(n: int, time_s: float, rate_hz: float, rng: np.random.Generator) -> Floats:
    """First-order noise (n, 3) of unit variance and this correlation time."""
    keep = float(np.exp(-1.0 / (time_s * rate_hz)))
    x = rng.standard_normal((n, 3))
    for k in range(1, n):
        x[k] = keep * x[k - 1] + np.sqrt(1.0 - keep**2) * x[k]
    return x


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
@pytest.mark.parametrize("worn", get_args(Worn))
def test_the_filter_alone_is_within_the_limits_when_orientations_are_given(worn: Worn, seed: int) -> None:
    take = given_orientations(seed)
    poses = take.run(worn)
    scores = trial_scores(take, poses)
    assert (scores[:, 0] < RMSE_LIMIT[worn]).all()
    assert (scores[:, 1] > R_LIMIT[worn]).all()
    for side in SIDES:
        strides = strides_of(take, poses, side)
        assert 100.0 * np.sqrt(np.mean((strides.found - strides.true) ** 2)) < STRIDE_CM
        assert abs(strides.distance_error) < DISTANCE


APART: Final[tuple[tuple[float, str], ...]] = (
    (0.0, "0"), (5.0, "toes in 5"), (-5.0, "toes out 5"), (10.0, "toes in 10"), (-10.0, "toes out 10"),
    (20.0, "toes in 20"), (-20.0, "toes out 20"),
)  # fmt: skip
"""How far the left foot's heading is turned to the right foot's, degrees."""
FOLDS_M: Final = 0.1
"""Joint ends so far apart: the figure has folded."""


def test_only_the_printed_adjoint_keeps_feet_together_whose_headings_disagree() -> None:
    take = trial("walk", *PEOPLE[1])
    rows, retained = [], {}
    for degrees, name in APART:
        off = turned_headings(take, {"foot_l": -degrees})
        cells = []
        for run in RUNS:
            poses = off.run(*run)
            retained[degrees, run] = trial_scores(off, poses), max(poses.diagnostics["hinge_m"].values())  # type: ignore[attr-defined]
            scores, hinge = retained[degrees, run]
            broken = f", hinge {100.0 * hinge:.0f} cm" if hinge > 0.01 else ""
            view = " / ".join(f"{x:.1f}" for x in scores[:, 0]) + broken
            # how far a folded figure is off hangs on the last bit of its input: it is no figure to write down
            cells.append("folds" if hinge > FOLDS_M else view)
        rows.append([name, *cells])
    record(
        "L7S: feet whose headings disagree",
        ["left foot °", *(f"{segment_names} {adjoint}" for segment_names, adjoint in RUNS)],
        rows,
        "Hip, knee and ankle flexion, RMSE without offset in °, of a simulated walk there and back in 30 s. "
        "Feet whose headings disagree walk apart, and only the constraints can hold them together. With the "
        "exact adjoint they do not: the hinge cannot be met any more and the figure folds (joint ends more "
        "than 10 cm apart). With the printed "
        "one they do up to ±10° (limits of straight walking asserted), which is why it is the default, "
        "although the exact one is better where headings agree.",
    )
    for (degrees, (segment_names, adjoint)), (scores, hinge) in retained.items():
        if abs(degrees) <= 10.0 and adjoint == "printed":
            assert (scores[:, 0] < RMSE_LIMIT[segment_names]).all()
            assert hinge < 1e-3
    for segment_names in get_args(Worn):
        assert (
            retained[-10.0, (segment_names, "exact")][1] > 0.01
            or retained[10.0, (segment_names, "exact")][1] > 0.01
        )


@pytest.mark.parametrize("worn", get_args(Worn))
def test_constraints_hold_and_turn_the_foot_from_where_its_sensor_points(worn: Worn) -> None:
    take = given_orientations(1)
    of_one = l7s_poses(
        take.orientations,
        take.acceleration,
        take.steps,
        take.truth.body,
        L7sParams(projections=1),
        worn,
        both_ways=False,
    )
    of_two = take.run(worn)
    for poses, limit_m in ((of_one, 0.010), (of_two, 1e-4)):
        for name in ("hinge_m", "excess_m"):
            assert max(poses.diagnostics[name].values()) < limit_m, name  # type: ignore[attr-defined]
    for side in SIDES:
        foot, shank = (to_matrix(of_two.q[s])[:, :, 2] for s in (FOOT[side], SHANK[side]))
        assert np.abs(np.sum(foot * shank, axis=1) - 1.0).max() < 1e-6
        turned = np.degrees(angle_between(of_two.q[FOOT[side]], take.orientations.q[FOOT[side]]).mean())
        # by design: docs/science/l7s.md, "Constraints"
        assert 1.0 < turned < 7.0
