from __future__ import annotations

import csv
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.frames import FOOT, SIDES, SUFFIX, Floats, Side
from sagittal.core.rotation import rotate
from sagittal.core.simulate import STEADY, Stand, Straight, Walker
from sagittal.core.simulate.gait.human import Motion, move
from sagittal.core.simulate.script import plan
from sagittal.core.simulate.truth import joint_angles
from tests.data import data_folder
from tests.helpers.walks import joint_gap

NORM_LIMITS_DEG = {
    "hip_flexion": 3.0,
    "knee_flexion": 3.5,
    "ankle_dorsiflexion": 3.5,
    "hip_adduction": 1.2,
    "pelvis_obliquity": 0.3,
    "pelvis_rotation": 0.3,
}
"""RMS from the WBDS adult mean (docs/science/simulation.md, "Limits on construction")."""

NORM_CORRELATION = {"hip_flexion": 0.98, "knee_flexion": 0.98, "ankle_dorsiflexion": 0.90}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["comfortable", "mixed"])
def test_joints_close(name: str, request: pytest.FixtureRequest) -> None:
    assert joint_gap(request.getfixturevalue(name).truth) <= 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("name", ["comfortable", "mixed"])
def test_a_flat_foot_does_not_move_at_all_and_is_on_its_footprint(
    name: str, request: pytest.FixtureRequest
) -> None:
    truth = request.getfixturevalue(name).truth
    for side in SIDES:
        events = truth.contacts[side]
        p, q = truth.p[FOOT[side]], truth.q[FOOT[side]]
        for i, footprint in enumerate(truth.footprints[side]):
            start = events.flat[i - 1] if i else 0.0
            end = events.heel_off[i] if i < len(events.heel_off) else truth.t_s[-1]
            still = (truth.t_s >= start) & (truth.t_s <= end)
            assert still.any()
            assert np.ptp(p[still], axis=0).max() == 0.0
            assert np.ptp(q[still], axis=0).max() == 0.0
            assert p[still][0, :2] == pytest.approx((footprint.x_m, footprint.y_m), abs=1e-12)


@pytest.mark.parametrize("name", ["comfortable", "mixed"])
def test_no_knee_straightens_below_its_limit(name: str, request: pytest.FixtureRequest) -> None:
    truth = request.getfixturevalue(name).truth
    for side in SIDES:
        assert np.degrees(truth.angles[f"knee_flexion_{SUFFIX[side]}"].min()) >= 2.9
        assert np.abs(truth.angles[f"knee_adduction_{SUFFIX[side]}"]).max() < 1e-7
        assert np.abs(truth.angles[f"knee_rotation_{SUFFIX[side]}"]).max() < 1e-7


def test_the_sole_stays_above_the_floor(steady_motion: Motion) -> None:
    for side in SIDES:
        assert steady_motion.sole_height[side].min() > -0.003


def _norm() -> dict[str, Floats]:
    curves: dict[str, list[float]] = {}
    with data_folder("norms", "kinematics_wbds_adult.csv").open() as file:
        for row in csv.DictReader(file):
            if row["group"] == "adult_21_84":
                curves.setdefault(row["variable"], []).append(float(row["mean_deg"]))
    return {name: np.array(values) for name, values in curves.items()}


@pytest.mark.recorded
@pytest.mark.parametrize("side", SIDES)
def test_curves_are_those_of_healthy_adults(steady_motion: Motion, side: Side) -> None:
    end = SUFFIX[side]
    angles = joint_angles(steady_motion.q)
    mirror = 1.0 if side == "right" else -1.0
    rightward = rotate(steady_motion.q["pelvis"], np.array([0.0, 0.0, 1.0]))
    angles["pelvis_rotation"] = np.arctan2(rightward[:, 0], -rightward[:, 1])
    norm = _norm()
    contacts = steady_motion.timings[side].contact[2:18]
    assert len(contacts) == 16
    phase = np.linspace(0.0, 1.0, 101)
    for name, limit in NORM_LIMITS_DEG.items():
        values = mirror * angles[name] if name.startswith("pelvis") else angles[f"{name}_{end}"]
        cycles = [np.interp(a + phase * (b - a), steady_motion.t_s, values) for a, b in pairwise(contacts)]
        mean = np.degrees(np.mean(cycles, axis=0))
        assert np.sqrt(np.mean((mean - norm[name]) ** 2)) <= limit, name
        assert np.corrcoef(mean, norm[name])[0, 1] >= NORM_CORRELATION.get(name, 0.97), name


def test_left_and_right_walk_alike(steady_motion: Motion) -> None:
    """Half a stride apart, in the mirror (docs/science/simulation.md, "Limits on construction")."""
    t, step = steady_motion.t_s, steady_motion.plan.typical_step_s
    angles = joint_angles(steady_motion.q)
    middle = (t > 12.0) & (t < 20.0)
    for name in ("hip_flexion", "hip_adduction", "hip_rotation", "knee_flexion", "ankle_dorsiflexion"):
        left = np.interp(t[middle] + step, t, angles[f"{name}_l"])
        assert np.degrees(left - angles[f"{name}_r"][middle]) == pytest.approx(0.0, abs=0.05), name


def _peak_accelerations(motion: Motion) -> dict[str, float]:
    return {
        segment: float(np.linalg.norm(np.diff(p, 2, axis=0) * motion.rate_hz**2, axis=1).max())
        for segment, p in motion.p.items()
    }


def test_accelerations_do_not_depend_on_the_grid(move_steadily: Callable[[float, float], Motion]) -> None:
    """Paths are C³: a corner would grow with the rate
    (docs/science/simulation.md, "Limits on construction")."""
    coarse, fine = (_peak_accelerations(move_steadily(rate, 1.75)) for rate in (400.0, 1600.0))
    for segment, value in coarse.items():
        assert fine[segment] == pytest.approx(value, rel=0.12), segment


@pytest.mark.slow
def test_a_taller_person_walks_with_the_same_angles(move_steadily: Callable[[float, float], Motion]) -> None:
    small, tall = move_steadily(400.0, 1.5), move_steadily(400.0, 1.9)
    for name, values in joint_angles(small.q).items():
        assert joint_angles(tall.q)[name] == pytest.approx(values, abs=1e-7), name
    assert tall.p["pelvis"] == pytest.approx(small.p["pelvis"] * 1.9 / 1.5, abs=1e-9)


def test_strides_vary_as_healthy_ones_do() -> None:
    """60 m: stride time CV 1 to 2 %, step length CV 2 to 3.2 %
    (docs/science/simulation.md, "Limits on construction")."""
    planned = plan((Stand(2.0), Straight(60.0, 0.64, 0.54), Stand(2.0)), Walker(), np.random.default_rng(5))
    times = np.array([s.time_s for s in planned.steps[2:-1] if s.side == "left"])
    lengths = np.array([s.step_m for s in planned.steps[1:-1]])
    assert 0.01 <= np.std(np.diff(times)) / np.mean(np.diff(times)) <= 0.02
    assert 0.02 <= np.std(lengths) / np.mean(lengths) <= 0.032


def test_too_long_steps_are_refused() -> None:
    walker = Walker(variability=STEADY)
    planned = plan((Stand(2.0), Straight(9.0, 1.5, 0.5), Stand(2.0)), walker, np.random.default_rng(0))
    with pytest.raises(ParameterError) as caught:
        move(planned, walker, 400.0)
    assert caught.value.code == "step_too_long"


@pytest.mark.parametrize("height", [0.4, 3.0])
def test_heights_without_such_a_walker_are_refused(height: float) -> None:
    with pytest.raises(ParameterError) as caught:
        Walker.of_height(height)
    assert caught.value.code == "height_implausible"
