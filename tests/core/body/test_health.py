"""Set-up errors appear in a health measure; correct set-ups raise no alarm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.body.estimate import PoseEstimate
from sagittal.core.body.health import HealthFinding, find_worst_verdict, longest_run_s
from sagittal.core.frames import FOOT, Segment
from sagittal.core.pipeline import TakeAnalysis, analyse
from sagittal.core.rotation import about, rotate
from sagittal.core.signals.recording import Recording, UniformRecording
from sagittal.core.simulate import simulate_scenario
from tests.core.body.test_estimate import estimated
from tests.helpers.marks import sweep_after
from tests.helpers.walks import simulated


def take(seed: int = 3, name: str = "fast_with_turns") -> UniformRecording:
    return simulated(name, seed)[0]


def swapped(recording: UniformRecording, a: Segment, b: Segment) -> UniformRecording:
    s = recording.sensors
    return replace(recording, sensors={**s, a: s[b], b: s[a]})


def changed(recording: UniformRecording, segment: Segment, **signals: object) -> UniformRecording:
    was = recording.sensors[segment]
    return replace(recording, sensors={**recording.sensors, segment: replace(was, **signals)})  # type: ignore[arg-type]


def codes(result: PoseEstimate) -> set[str]:
    return {n.code for n in result.poses.notices}


def residuals(result: PoseEstimate) -> dict[str | None, float]:
    return {f.of: f.value for f in result.poses.health if f.name == "joint_residual_mm"}


def test_a_verdict_follows_the_limits() -> None:
    assert [HealthFinding("x", None, v, 1.0, 2.0).verdict for v in (1.0, 1.5, 2.5)] == ["good", "warn", "bad"]
    assert HealthFinding("x", None, float("nan"), 1.0, 2.0).verdict == "bad"
    assert HealthFinding("x", None, 9.0).verdict == "good"
    assert (
        find_worst_verdict([HealthFinding("x", None, 0.0, 1.0), HealthFinding("y", None, 3.0, 1.0)]) == "warn"
    )
    assert find_worst_verdict([]) == "good"


def test_the_longest_run_is_found_wherever_it_lies() -> None:
    assert longest_run_s(np.array([1, 1, 0, 1, 1, 1], bool), 10.0) == pytest.approx(0.3)
    assert longest_run_s(np.zeros(5, bool), 10.0) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "seed"),
    sweep_after(1, [("comfortable", 3), ("fast_with_turns", 2), ("hemiparetic", 4), ("drop_foot", 5)]),
)
def test_a_right_set_up_is_not_accused(name: str, seed: int) -> None:
    estimate = estimated(take(seed, name))
    accused = {"sensors_do_not_hang_together", "zero_velocity_refused", "foot_never_still", "started_moving"}
    assert not codes(estimate) & accused
    assert max(residuals(estimate).values()) < 10.0
    assert (
        find_worst_verdict([f for f in estimate.poses.health if f.name != "forward_axis_turned_deg"])
        == "good"
    )


@pytest.mark.slow
@pytest.mark.parametrize(("a", "b"), [("thigh_l", "thigh_r"), ("shank_l", "shank_r"), ("foot_l", "foot_r")])
def test_exchanged_sides_do_not_hang_together(a: Segment, b: Segment) -> None:
    estimate = estimated(swapped(take(), a, b))
    assert "sensors_do_not_hang_together" in codes(estimate)
    # places found from motion bend a little towards a wrong set-up
    assert max(residuals(estimate).values()) > 25.0


@pytest.mark.slow
def test_exchanged_segments_of_one_leg_are_told() -> None:
    estimate = estimated(swapped(take(), "thigh_l", "shank_l"))
    assert find_worst_verdict(estimate.poses.health) != "good"
    assert codes(estimate) & {"sensors_do_not_hang_together", "heading_corrected"}


@pytest.mark.slow
def test_a_late_sensor_shows_in_its_joints() -> None:
    was = take().sensors["thigh_r"]
    acc, gyr = (np.roll(x, 30, axis=0).copy() for x in (was.acc, was.gyr))
    estimate = estimated(changed(take(), "thigh_r", acc=acc, gyr=gyr))
    right, left = residuals(estimate)["pelvis-thigh_r"], residuals(estimate)["pelvis-thigh_l"]
    assert right > 2.0 * left


@pytest.mark.slow
def test_a_foot_that_never_rests_is_told() -> None:
    was = take().sensors["foot_l"]
    shaken = was.gyr + 1.5 * np.sin(2 * np.pi * 7.0 * take().t_s)[:, None] * (take().t_s > 8.0)[:, None]
    estimate = estimated(changed(take(), "foot_l", gyr=shaken))
    assert "foot_never_still" in codes(estimate)
    (notices,) = [f for f in estimate.poses.health if (f.name, f.of) == ("longest_moving_s", "foot_l")]
    assert notices.verdict == "bad"


@pytest.mark.sweep
@pytest.mark.parametrize("lost_s", [0.5, 8.0])
def test_a_known_gap_is_bridged_told_and_recovered(lost_s: float) -> None:
    was = take().sensors["shank_r"]
    gap = (take().t_s >= 20.0) & (take().t_s < 20.0 + lost_s)
    held = {
        "acc": np.where(gap[:, None], was.acc[2000], was.acc),
        "gyr": np.where(gap[:, None], was.gyr[2000], was.gyr),
        "valid": was.valid & ~gap,
    }
    estimate = estimated(changed(take(), "shank_r", **held))
    assert ("gap_bridged" in codes(estimate)) == (lost_s > 0.5)
    assert max(residuals(estimate).values()) < 30.0
    whole = estimated(take())
    final = take().t_s > 32.0
    for segment in ("thigh_r", "shank_r", "foot_r"):
        apart = estimate.poses.q[segment][final] - whole.poses.q[segment][final]
        assert np.abs(apart).max() < 0.1


@pytest.mark.slow
def test_an_unnoticed_gap_never_gives_numbers_that_are_none() -> None:
    was = take().sensors["foot_r"]
    gap = (take().t_s >= 20.0) & (take().t_s < 20.3)
    held = {
        "acc": np.where(gap[:, None], was.acc[2000], was.acc),
        "gyr": np.where(gap[:, None], was.gyr[2000], was.gyr),
    }
    estimate = estimated(changed(take(), "foot_r", **held))
    for p in estimate.poses.p.values():
        assert np.isfinite(p).all()
    end = estimate.poses.p["pelvis"][-1] - estimated(take()).poses.p["pelvis"][-1]
    assert np.linalg.norm(end) < 10.0


@pytest.mark.slow
def test_a_burst_of_no_numbers_is_a_gap() -> None:
    simulation = simulate_scenario("fast_with_turns", 3)
    device = next(d for d, s in simulation.recording.segments.items() if s == "shank_l")
    stream = simulation.recording.streams[device]
    acc, gyr = stream.acc.copy(), stream.gyr.copy() if stream.gyr is not None else None
    assert gyr is not None
    acc[2000:2040], gyr[2000:2040] = np.nan, np.nan
    broken: Recording = replace(
        simulation.recording,
        streams={**simulation.recording.streams, device: replace(stream, acc=acc, gyr=gyr)},
    )
    done: TakeAnalysis = analyse(broken)
    assert done.problem is None
    assert done.poses is not None
    assert done.poses.method == "erkf_smoothed"
    assert np.isfinite(done.poses.p["shank_l"]).all()
    assert done.angles is not None
    assert np.isnan(done.angles.angles["knee_flexion_l"]).any()


@pytest.mark.slow
def test_a_foot_sensor_put_on_backwards_walks_all_the_same_or_is_told() -> None:
    was = take().sensors["foot_l"]
    half = about(2, np.pi)
    estimate = estimated(changed(take(), "foot_l", acc=rotate(half, was.acc), gyr=rotate(half, was.gyr)))
    whole = estimated(take())
    if not codes(estimate) & {"sensors_do_not_hang_together", "heading_corrected"}:
        apart = estimate.poses.q[FOOT["left"]] - whole.poses.q[FOOT["left"]]
        assert np.abs(apart).max() < 0.1
