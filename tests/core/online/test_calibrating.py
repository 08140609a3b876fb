"""Live calibration: stages, waiting and messages, and equality with the offline one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.body import nominal_body
from sagittal.core.body.apart import lean_legs_apart
from sagittal.core.body.choice import WHOLE
from sagittal.core.body.erkf.headings import align_forward_axes
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.calibration import calibrate
from sagittal.core.calibration.live_attempt import WornSensors
from sagittal.core.frames import Segment
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.online.calibrated import LiveCalibration
from sagittal.core.online.calibrating import LiveCalibrator
from sagittal.core.online.frame import CalibrationView, Stage
from sagittal.core.rotation import conjugate, exp, multiply, rotate
from sagittal.core.signals.recording import Subject, UniformRecording
from sagittal.core.simulate import Arc, Pivot, Stand, Straight
from sagittal.core.timeline.live import UniformBlock
from tests.helpers.walks import TOGETHER, cut, lost, neura_walk, only, scripted, simulated

Seen = tuple[int, Stage, CalibrationView]


@dataclass(frozen=True, eq=False)
class Run:
    """Calibrator after some samples, its results, and each change of its message."""

    calibrator: LiveCalibrator
    found: tuple[LiveCalibration, ...]
    seen: tuple[Seen, ...]

    @property
    def stages(self) -> tuple[Stage, ...]:
        """Stages in order."""
        order = [stage for _, stage, _ in self.seen]
        return tuple(s for i, s in enumerate(order) if i == 0 or s != order[i - 1])


def wearer(recording: UniformRecording) -> WornSensors:
    return WornSensors(
        tuple(recording.sensors), recording.rate_hz, recording.subject, recording.protocol, recording.mounting
    )


def blocks(recording: UniformRecording, n: int) -> Iterator[UniformBlock]:
    acc, gyr = (
        np.stack([getattr(s, name) for s in recording.sensors.values()], axis=1) for name in ("acc", "gyr")
    )
    valid, filled = (
        np.stack([getattr(s, name) for s in recording.sensors.values()], axis=1)
        for name in ("valid", "interpolated")
    )
    for a in range(0, len(recording.t_s), n):
        p = slice(a, a + n)
        yield UniformBlock(a, recording.t_s[p], acc[p], gyr[p], valid[p], filled[p])


def run(
    recording: UniformRecording,
    n: int = 50,
    at: Callable[[LiveCalibrator, int], None] = lambda calibrator, past: None,
) -> Run:
    """Push a recording in blocks of n; `at` is called after each with the samples so far."""
    calibrator = LiveCalibrator(wearer(recording))
    result: list[LiveCalibration] = []
    observations: list[Seen] = []
    for block in blocks(recording, n):
        if (calibration := calibrator.push(block)) is not None:
            result.append(calibration)
        past = block.first + len(block)
        at(calibrator, past)
        if not observations or (calibrator.stage, calibrator.view) != observations[-1][1:]:
            observations.append((past, calibrator.stage, calibrator.view))
    return Run(calibrator, tuple(result), tuple(observations))


@cache
def walk(seconds: float = 30.0) -> UniformRecording:
    """Seven sensors: standing, straight walk."""
    return cut(simulated("comfortable")[0], 0.0, seconds)


@cache
def walked() -> Run:
    return run(walk())


def test_stand_walk_and_it_runs() -> None:
    done = walked()
    assert done.stages == ("stand", "walk", "running")
    assert len(done.found) == 1
    result = done.found[0]
    assert result.ok
    assert result.first == 0
    assert result.past % 50 == 0
    assert len(result.calibrated.recording.t_s) == result.past - result.first
    assert done.calibrator.view.ok
    assert done.calibrator.view.steps >= 8 or done.calibrator.view.walked_s >= 12.0
    assert {c.segment for c in result.checks} == set(walk().sensors)
    assert all(c.method == "walking_direction" and c.score and c.score > 0.5 for c in result.checks)


def test_its_score_judges_the_joints_too_and_is_gone_when_it_begins_anew() -> None:
    done = walked()
    (result,) = done.found
    score = result.score
    assert score.verdict == "pass"
    segments = {c.segment for c in score.checks if c.name == "joint_misfit" and c.verdict == "pass"}
    assert segments == set(WHOLE)
    assert done.seen[-1][2].score == score
    assert all(view.score is None for _, stage, view in done.seen if stage != "running")


def test_it_is_the_offline_calibration_of_the_same_samples() -> None:
    result = walked().found[0]
    part = cut(walk(), 0.0, result.past / 100.0)
    calibrated = calibrate(part)
    body, _ = nominal_body(part.subject.height_m, part.subject.standing_width_m, part.subject.shoe)
    calibrated, orientations = lean_legs_apart(calibrated, estimate_orientations(calibrated), body)
    offline, _, turned = align_forward_axes(calibrated, orientations, body, WHOLE, ErkfParams.people())
    assert result.turned == turned
    for segment, mounted in offline.calibration.segments.items():
        ours = result.calibrated.calibration.segments[segment]
        assert np.array_equal(ours.R_segment_sensor, mounted.R_segment_sensor)
        assert np.array_equal(ours.gyro_bias, mounted.gyro_bias)


@pytest.mark.sweep
@pytest.mark.parametrize("n", [1, 7, 333, 10_000])
def test_no_border_of_a_block_is_seen_in_it(n: int) -> None:
    result, repeat = walked().found[0], run(walk(), n).found[0]
    assert (repeat.first, repeat.past) == (result.first, result.past)
    assert repeat.checks == result.checks
    for segment, mounted in result.calibrated.calibration.segments.items():
        other_segments = repeat.calibrated.calibration.segments[segment]
        assert other_segments.R_segment_sensor.tobytes() == mounted.R_segment_sensor.tobytes()


def test_what_is_said_is_the_same_at_the_same_sample_whatever_the_blocks() -> None:
    fine = {past: (stage, view) for past, stage, view in run(walk(), 10).seen}
    for past, stage, view in walked().seen:
        if past in fine:
            assert fine[past] == (stage, view)


def test_it_says_how_long_was_stood_and_who_is_still() -> None:
    standing = [view for _, stage, view in walked().seen if stage == "stand" and view.stood_s]
    assert [view.stood_s for view in standing] == sorted(view.stood_s for view in standing)
    assert all(c.still for c in standing[-1].checks)
    assert standing[-1].stood_s < 3.0
    walking = [view for _, stage, view in walked().seen if stage == "walk" and view.walked_s > 2.0]
    assert not any(c.still for view in walking for c in view.checks)
    assert [v.steps for v in walking] == sorted(v.steps for v in walking)


def test_a_sensor_that_moves_is_named_and_nothing_begins() -> None:
    recording = cut(walk(), 0.0, 4.0)
    x = recording.sensors["shank_l"]
    t = recording.t_s[:, None]
    swinging = replace(x, gyr=x.gyr + 0.6 * np.sin(2 * np.pi * 1.5 * t) * np.array([0.0, 0.0, 1.0]))
    done = run(replace(recording, sensors={**recording.sensors, "shank_l": swinging}))
    assert done.stages == ("stand",)
    assert [c.segment for c in done.calibrator.view.checks if not c.still] == ["shank_l"]
    assert done.calibrator.view.stood_s == 0.0


@pytest.mark.sweep
def test_redo_begins_anew_with_the_next_sample() -> None:
    recording, _ = scripted(
        (
            Stand(5.0), Straight(12.0, 0.6, 0.55), *TOGETHER, Stand(5.0), Straight(12.0, 0.6, 0.55),
            Stand(2.0),
        )
    )  # fmt: skip
    first = run(recording).found[0]
    assert len(run(recording).found) == 1

    def again(calibrator: LiveCalibrator, past: int) -> None:
        if past == first.past + 100:
            calibrator.redo()
            assert calibrator.stage == "waiting"
            assert calibrator.view.ok is None

    done = run(recording, at=again)
    assert len(done.found) == 2
    second = done.found[1]
    assert second.first >= first.past + 100
    assert second.ok
    assert done.stages == ("stand", "walk", "running", "waiting", "stand", "walk", "running")
    assert second.calibrated.recording.t_s[0] == 0.0


@pytest.mark.sweep
def test_blocks_need_not_be_pushed_while_it_runs() -> None:
    first = walked().found[0]
    calibrator = LiveCalibrator(wearer(walk()))
    repeat: list[LiveCalibration] = []
    for block in blocks(joined(walk(), walk()), 50):
        if block.first == 3000:
            assert calibrator.stage == "running"
            calibrator.redo()
        if calibrator.stage != "running" and (frame := calibrator.push(block)) is not None:
            repeat.append(frame)
    assert [(x.first, x.past) for x in repeat] == [(0, first.past), (3000, 3000 + first.past)]
    mounts = [x.calibrated.calibration.segments["shank_r"].R_segment_sensor for x in repeat]
    assert np.array_equal(mounts[0], mounts[1])


@pytest.mark.sweep
def test_a_person_may_stand_for_long_and_only_the_last_of_it_is_kept() -> None:
    recording, _ = scripted((Stand(60.0), Straight(14.0, 0.6, 0.55), Stand(2.0)))
    result = run(recording).found[0]
    assert result.past - result.first < 30 * 100
    begins = result.calibrated.calibration.walking[0][0]
    assert 10.0 < begins < 17.0
    assert result.ok


@pytest.mark.sweep
def test_who_moves_before_walking_stands_again() -> None:
    """Shifting between feet is no walk; standing must be repeated."""
    still = cut(walk(), 0.0, 4.0)
    rng = np.random.default_rng(3)
    sway = replace(
        still,
        sensors={
            s: replace(
                x, gyr=x.gyr + 0.25 * np.sin(2 * np.pi * 0.7 * still.t_s[:, None] + rng.uniform(0, 6, 3))
            )
            for s, x in still.sensors.items()
        },
    )
    done = run(joined(still, sway, sway, sway, sway, walk()))
    assert done.stages == ("stand", "walk", "stand", "walk", "running")
    assert done.found[0].first > 500
    assert done.found[0].ok


@pytest.mark.sweep
def test_turning_on_the_spot_is_no_walk_and_it_says_so() -> None:
    spin = tuple(Pivot(3.0, 0.6, 0.55) for _ in range(6))
    recording, _ = scripted((Stand(5.0), *spin, Stand(6.0), Straight(14.0, 0.6, 0.55), Stand(2.0)))
    done = run(recording)
    problems = [(stage, v.problem.code, v.ok) for _, stage, v in done.seen if v.problem is not None]
    assert problems[0] == ("stand", "no_walking", False)
    assert done.stages == ("stand", "walk", "stand", "walk", "running")
    assert done.calibrator.view.problem is None
    assert done.found[0].ok


@pytest.mark.sweep
def test_a_walk_round_a_corner_has_twelve_seconds() -> None:
    """Few straight steps, so the time decides."""
    recording, _ = scripted(
        (Stand(5.0), Straight(2.4, 0.6, 0.6), Arc(1.0, 3.1, 0.5, 0.6), Straight(1.8, 0.6, 0.6),
         Arc(1.0, 3.1, 0.5, 0.6), Straight(1.8, 0.6, 0.6), Stand(2.0))
    )  # fmt: skip
    done = run(recording)
    assert len(done.found) == 1
    assert 12.0 <= done.calibrator.view.walked_s < 13.0


def strapped_on(seed: int) -> UniformRecording:
    """Seven sensors rest for 4 s, then are picked up one by one, rotated and put down differently."""
    rng = np.random.default_rng(seed)
    first = walk()
    n, sensors = 3400, {}
    for i, (segment, x) in enumerate(first.sensors.items()):
        t = np.arange(n) / 100.0
        held = (t > 4.0 + 4.0 * i) & (t < 10.0 + 4.0 * i)
        rate = (
            2.0
            * np.sin(2 * np.pi * rng.uniform(0.2, 1.0, 3) * t[:, None] + rng.uniform(0, 6, 3))
            * held[:, None]
        )
        q = np.empty((n, 4))
        q[0] = 1.0, 0.0, 0.0, 0.0
        for k in range(1, n):
            q[k] = multiply(q[k - 1], exp(0.01 * rate[k]))
        push = 3.0 * np.sin(2 * np.pi * rng.uniform(0.3, 2.0, 3) * t[:, None]) * held[:, None]
        acc = rotate(conjugate(q), np.array([0.0, 0.0, 9.81])) + push + rng.normal(0, 0.02, (n, 3))
        gyr = rate + rng.normal(0, 0.002, (n, 3))
        mask = np.ones(n, np.bool_)
        sensors[segment] = replace(x, acc=acc, gyr=gyr, mag=None, valid=mask, interpolated=~mask)
    return replace(first, t_s=np.arange(n) / 100.0, sensors=sensors)


@pytest.mark.sweep
@pytest.mark.parametrize("seed", range(4))
def test_strapping_sensors_on_is_no_walk(seed: int) -> None:
    done = run(joined(strapped_on(seed), walk()))
    assert len(done.found) == 1
    result = done.found[0]
    assert result.ok
    assert result.first >= 3400
    single_segments = walked().found[0].calibrated.calibration.segments
    for segment, mounted in result.calibrated.calibration.segments.items():
        assert np.allclose(mounted.R_segment_sensor, single_segments[segment].R_segment_sensor, atol=0.03)


@pytest.mark.sweep
def test_a_sensor_turned_between_two_standings_makes_the_second_count() -> None:
    recording, _ = scripted(
        (
            Stand(5.0), Straight(2.4, 0.6, 0.55), *TOGETHER, Stand(6.0), Straight(14.0, 0.6, 0.55),
            Stand(2.0),
        )
    )  # fmt: skip
    n = 700
    by_key = exp(np.array([0.0, 0.0, 0.6]))
    x = recording.sensors["shank_r"]
    acc, gyr = (np.where(np.arange(len(v))[:, None] < n, rotate(by_key, v), v) for v in (x.acc, x.gyr))
    initial_variant = replace(
        recording, sensors={**recording.sensors, "shank_r": replace(x, acc=acc, gyr=gyr, mag=None)}
    )
    plain, done = run(recording), run(initial_variant)
    notices = [v.problem for _, _, v in done.seen if v.problem is not None]
    assert {p.code for p in notices} == {"sensor_moved"}
    assert {p.sensor for p in notices} == {"shank_r"}
    assert plain.found[0].first == 0
    assert done.found[0].first > n
    assert done.found[0].ok


@pytest.mark.sweep
def test_a_take_in_which_hardly_anybody_walks_begins_anew() -> None:
    recording, _ = scripted((Stand(5.0), Straight(2.4, 0.6, 0.55), Stand(125.0)))
    done = run(recording, 500)
    problems = [v.problem.code for _, _, v in done.seen if v.problem is not None]
    assert problems
    assert set(problems) == {"walk_too_short"}
    assert done.found == ()


@pytest.mark.sweep
def test_a_contradicting_mounting_is_told_and_not_calibrated() -> None:
    recording, _ = scripted((Stand(5.0), Straight(16.0, 0.6, 0.55), Stand(4.0)))
    left, right = (run(replace(recording, mounting={"shank_l": f"face {way}"})) for way in ("left", "right"))
    selection, refused = (left, right) if left.found else (right, left)
    assert selection.found[0].ok
    assert refused.found == ()
    problems = {v.problem.code for _, _, v in refused.seen if v.problem is not None}
    assert problems == {"calibration_sign_conflict"}


@pytest.mark.parametrize(
    "worn", [("foot_l", "foot_r"), ("pelvis", "foot_l", "foot_r"), ("pelvis", "thigh_r", "shank_r", "foot_r")]
)
def test_any_subset_is_calibrated(worn: tuple[Segment, ...]) -> None:
    done = run(only(walk(), *worn))
    result = done.found[0]
    assert set(result.calibrated.calibration.segments) == set(worn)
    assert set(result.turned) == (set(worn) if "thigh_r" in worn else set())
    assert result.ok


def test_a_sensor_that_sends_nothing_is_waited_for_and_then_left_out() -> None:
    recording = lost(joined(cut(walk(), 0.0, 4.0), cut(walk(), 0.0, 4.0), cut(walk(), 0.0, 4.0), walk()),
                     "thigh_l", 0.01, 60.0)  # fmt: skip
    done = run(recording)
    assert done.stages == ("waiting", "walk", "running")
    began = next(past for past, stage, _ in done.seen if stage == "walk")
    assert began == 1000
    result = done.found[0]
    assert "thigh_l" not in result.calibrated.recording.sensors
    assert not result.ok
    (check,) = (c for c in result.checks if c.segment == "thigh_l")
    assert check.method is None
    assert [n.code for n in check.notices] == ["sensor_missing"]


def test_without_any_sensor_it_waits() -> None:
    recording = walk()
    for segment in recording.sensors:
        recording = lost(recording, segment, 0.01, 30.0)
    done = run(recording)
    assert done.stages == ("waiting",)
    assert done.found == ()


@pytest.mark.sweep
def test_the_standing_width_leans_the_legs() -> None:
    wide = replace(walk(), subject=Subject(1.75, 0.30))
    narrow = replace(walk(), subject=Subject(1.75, None))
    a, b = (run(x).found[0].calibrated.calibration.segments["thigh_l"] for x in (wide, narrow))
    assert not np.allclose(a.R_segment_sensor, b.R_segment_sensor, atol=1e-3)


@pytest.mark.recorded
def test_neura_walk_is_calibrated_before_it_ends() -> None:
    done = run(neura_walk(), 10)
    result = done.found[0]
    assert done.stages == ("waiting", "stand", "walk", "running")
    assert result.ok
    assert result.past < len(neura_walk().t_s) - 200


def joined(*parts: UniformRecording) -> UniformRecording:
    """Takes one after the other."""
    first = parts[0]
    sensors = {
        s: replace(
            x,
            acc=np.concatenate([p.sensors[s].acc for p in parts]),
            gyr=np.concatenate([p.sensors[s].gyr for p in parts]),
            mag=None,
            valid=np.concatenate([p.sensors[s].valid for p in parts]),
            interpolated=np.concatenate([p.sensors[s].interpolated for p in parts]),
        )
        for s, x in first.sensors.items()
    }
    n = sum(len(p.t_s) for p in parts)
    return replace(first, t_s=np.arange(n) / first.rate_hz, sensors=sensors)
