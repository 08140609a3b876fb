"""L7S on what goes wrong with few sensors: a named error, or a flag with the quantity that shows it."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.body.estimate import PoseEstimate
from sagittal.core.body.health import HealthFinding, Verdict
from sagittal.core.body.l7s.filter import filter_block, start_l7s_state
from sagittal.core.body.l7s.health import INNER_M, list_health_notices
from sagittal.core.body.l7s.inputs import free_acceleration, take_of
from sagittal.core.body.l7s.legs import LegModel
from sagittal.core.body.l7s.poses import l7s_poses
from sagittal.core.body.model import BodyModel
from sagittal.core.body.pose_params import PoseParams
from sagittal.core.calibration import calibrate
from sagittal.core.errors import EstimationError, SagittalError
from sagittal.core.estimators import Estimator
from sagittal.core.frames import FOOT, SIDES, Floats, Segment
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.pipeline import PipelineConfig, analyse
from sagittal.core.rotation import about, multiply, rotate
from sagittal.core.signals.held_samples import SampleSeries
from sagittal.core.signals.recording import Recording, SensorSignals, UniformRecording
from sagittal.core.simulate import simulate_scenario
from tests.core.body.l7s.test_poses import still_feet
from tests.core.body.test_estimate import FEET, PELVIS_FEET, estimated
from tests.helpers.marks import sweep_after
from tests.helpers.walks import cut, lost, only, simulated

SEEN = {"l7s_3i": PELVIS_FEET, "l7s_2i": FEET}
BOTH: tuple[Estimator, ...] = ("l7s_3i", "l7s_2i")


def take(estimator: Estimator, name: str = "fast_with_turns") -> UniformRecording:
    """A walk with turns and the sensors of the estimator."""
    return only(simulated(name, 3)[0], *SEEN[estimator])


def run(recording: UniformRecording, estimator: Estimator) -> PoseEstimate:
    estimate = estimated(recording, PoseParams(estimator=estimator))
    assert estimate.poses.method == estimator
    return estimate


@cache
def right(estimator: Estimator, name: str = "fast_with_turns") -> PoseEstimate:
    """What the walk gives when nothing is wrong."""
    return run(take(estimator, name), estimator)


def codes(result: PoseEstimate) -> set[str]:
    return {n.code for n in result.poses.notices}


def finding(recording: PoseEstimate, name: str, source: str | None = None) -> tuple[float, Verdict]:
    (result,) = (f for f in recording.poses.health if (f.name, f.of) == (name, source))
    return result.value, result.verdict


def wearing(recording: UniformRecording, **sensors: SensorSignals) -> UniformRecording:
    return replace(recording, sensors={**recording.sensors, **sensors})  # type: ignore[dict-item]


ACCUSING = {
    "feet_drift_apart", "feet_out_of_step", "feet_exchanged", "not_a_pelvis", "gap_not_bridged",
    "legs_do_not_fit", "foot_never_still", "pelvis_rises", "places_not_found",
}  # fmt: skip


@pytest.mark.sweep
@pytest.mark.parametrize("estimator", BOTH)
@pytest.mark.parametrize(
    ("name", "seed"),
    sweep_after(2, [
        ("comfortable", 2), ("slow", 4), ("fast_with_turns", 3), ("hemiparetic", 3), ("drop_foot", 5),
        ("antalgic", 3), ("crouch", 4), ("parkinson", 2), ("elderly", 5),
    ]),
)  # fmt: skip
def test_a_right_set_up_is_not_accused(name: str, seed: int, estimator: Estimator) -> None:
    result = run(only(simulated(name, seed)[0], *SEEN[estimator]), estimator)
    assert not codes(result) & ACCUSING
    assert all(f.verdict == "good" for f in result.poses.health)


@pytest.mark.sweep
@pytest.mark.parametrize("name", ["comfortable", "fast_with_turns", "hemiparetic"])
def test_exchanged_feet_show_in_where_the_pelvis_falls(name: str) -> None:
    recording = take("l7s_3i", name)
    s = recording.sensors
    result = run(wearing(recording, foot_l=s["foot_r"], foot_r=s["foot_l"]), "l7s_3i")
    assert "feet_exchanged" in codes(result)
    as_worn, wrong = (finding(m, "toward_foot_mps2") for m in (right("l7s_3i", name), result))
    assert wrong[1] == "bad"
    assert as_worn[0] < 0.0 < wrong[0]


@pytest.mark.sweep
def test_without_a_pelvis_exchanged_feet_shift_what_turns_show_and_nothing_is_said_below_the_limit() -> None:
    recording = take("l7s_2i")
    s = recording.sensors
    result = run(wearing(recording, foot_l=s["foot_r"], foot_r=s["foot_l"]), "l7s_2i")
    assert "feet_exchanged" not in codes(result)
    assert finding(result, "inner_foot_m")[0] > 0.0
    (notices,) = list_health_notices([HealthFinding("inner_foot_m", None, 0.2, *INNER_M)])
    assert notices.code == "feet_exchanged"
    # minus the distance of the feet across the way
    assert -0.2 < finding(right("l7s_2i"), "inner_foot_m")[0] < -0.05


@pytest.mark.sweep
def test_without_turn_and_pelvis_sides_are_not_measured() -> None:
    value, verdict = finding(right("l7s_2i", "comfortable"), "inner_foot_m")
    assert np.isnan(value)
    assert verdict == "good"
    assert "inner_foot_m" not in {f.name for f in right("l7s_3i", "comfortable").poses.health}


@pytest.mark.sweep
@pytest.mark.parametrize("estimator", BOTH)
def test_one_sensor_given_for_both_feet_is_told(estimator: Estimator) -> None:
    recording = take(estimator)
    result = run(wearing(recording, foot_r=recording.sensors["foot_l"]), estimator)
    assert "feet_out_of_step" in codes(result)
    value, verdict = finding(result, "phase_off_pct")
    assert (round(value), verdict) == (50, "bad")


@pytest.mark.sweep
@pytest.mark.parametrize("estimator", BOTH)
def test_a_foot_with_a_late_clock_is_told(estimator: Estimator) -> None:
    recording = take(estimator)
    was = recording.sensors["foot_l"]
    late = replace(was, acc=np.roll(was.acc, 20, axis=0).copy(), gyr=np.roll(was.gyr, 20, axis=0).copy())
    result = run(wearing(recording, foot_l=late), estimator)
    assert "feet_out_of_step" in codes(result)
    value, verdict = finding(result, "phase_off_pct")
    # 0.2 s of a stride of 0.94 s
    assert value == pytest.approx(21.0, abs=3.0)
    assert verdict == "warn"


def test_a_sensor_taken_for_the_pelvis_that_sits_on_a_thigh_is_told() -> None:
    thigh = simulated("fast_with_turns", 3)[0].sensors["thigh_r"]
    result = run(wearing(take("l7s_3i"), pelvis=thigh), "l7s_3i")
    assert "not_a_pelvis" in codes(result)
    assert finding(result, "pelvis_tilt_sd_deg")[1] == "bad"


@pytest.mark.sweep
@pytest.mark.parametrize("estimator", BOTH)
def test_a_sensor_taken_for_a_foot_that_sits_on_the_shank_is_told(estimator: Estimator) -> None:
    shank = simulated("fast_with_turns", 3)[0].sensors["shank_l"]
    result = run(wearing(take(estimator), foot_l=shank), estimator)
    assert "foot_never_still" in codes(result)
    assert finding(result, "longest_moving_s", "foot_l")[1] == "bad"


def test_pelvis_and_foot_exchanged_are_told() -> None:
    recording = take("l7s_3i")
    s = recording.sensors
    result = run(wearing(recording, pelvis=s["foot_l"], foot_l=s["pelvis"]), "l7s_3i")
    assert codes(result) >= {"not_a_pelvis", "feet_drift_apart"}
    assert finding(result, "feet_out_of_place_pct")[1] == "bad"


@pytest.mark.sweep
@pytest.mark.parametrize("estimator", BOTH)
def test_calibration_finds_forward_of_a_foot_sensor_put_on_backwards(estimator: Estimator) -> None:
    recording, half = take(estimator), about(2, np.pi)
    was = recording.sensors["foot_l"]
    backwards = replace(was, acc=rotate(half, was.acc), gyr=rotate(half, was.gyr), mag=None)
    result, whole = run(wearing(recording, foot_l=backwards), estimator), right(estimator)
    for segment, p in whole.poses.p.items():
        np.testing.assert_allclose(result.poses.p[segment], p, atol=1e-3)


@pytest.mark.parametrize("estimator", BOTH)
def test_a_foot_that_faces_backwards_after_calibration_is_refused(estimator: Estimator) -> None:
    recording = take(estimator)
    calibrated = calibrate(recording)
    orientations = estimate_orientations(calibrated)
    turned = {**orientations.q, "foot_r": multiply(about(2, np.pi), orientations.q["foot_r"])}
    with pytest.raises(EstimationError) as error:
        l7s_poses(
            replace(orientations, q=turned),
            free_acceleration(calibrated, orientations),
            still_feet(calibrated),
            BodyModel.from_height(1.75),
        )
    assert (error.value.code, error.value.sensor) == ("headings_apart", "foot_r")
    assert re.search(r"points 1[78]\d° away", error.value.message)


@pytest.mark.sweep
@pytest.mark.parametrize(("off_deg", "verdict"), [(0.0, "good"), (20.0, "bad"), (-20.0, "bad")])
@pytest.mark.parametrize("estimator", BOTH)
def test_feet_whose_headings_disagree_are_told(
    estimator: Estimator, off_deg: float, verdict: Verdict
) -> None:
    calibrated = calibrate(take(estimator))
    orientations = estimate_orientations(calibrated)
    acceleration, turn = free_acceleration(calibrated, orientations), about(2, np.radians(off_deg))
    q = {**orientations.q, "foot_l": multiply(turn, orientations.q["foot_l"])}
    moved: dict[Segment, SampleSeries] = {**acceleration, "foot_l": rotate(turn, acceleration["foot_l"][:])}
    body = simulated("fast_with_turns", 3)[1].body
    poses = l7s_poses(replace(orientations, q=q), moved, still_feet(calibrated), body)
    (result,) = (f for f in poses.health if f.name == "feet_out_of_place_pct")
    assert result.verdict == verdict
    assert ("feet_drift_apart" in {n.code for n in poses.notices}) == (verdict != "good")


@pytest.mark.sweep
@pytest.mark.parametrize("estimator", BOTH)
def test_a_gap_of_half_a_second_of_a_foot_is_told_and_the_rest_stays_finite(estimator: Estimator) -> None:
    result = run(lost(take(estimator), "foot_l", 20.0, 20.5), estimator)
    assert "gap_not_bridged" in codes(result)
    value, verdict = finding(result, "gap_s", "foot_l")
    assert (round(value, 2), verdict) == (0.5, "bad")
    for p in result.poses.p.values():
        assert np.isfinite(p).all()
    valid, rests = result.poses.valid, result.poses.contact["foot_l"]
    second = 2050 + int(np.argmax(rests[2050:]))
    assert not valid[2000:second].any(), "until the foot rests nobody knows where it went"
    assert valid[second]
    assert second < 2150


@pytest.mark.sweep
def test_a_gap_of_the_pelvis_is_bridged_by_the_feet() -> None:
    whole = right("l7s_3i")
    result = run(lost(take("l7s_3i"), "pelvis", 20.0, 20.5), "l7s_3i")
    assert "gap_not_bridged" not in codes(result)
    assert finding(result, "gap_s", "pelvis")[1] == "good"
    final_window = slice(2300, 4000)
    for side in SIDES:
        apart = result.poses.p[FOOT[side]][final_window] - whole.poses.p[FOOT[side]][final_window]
        assert np.abs(apart - apart.mean(axis=0)).max() < 0.1


@pytest.mark.sweep
@pytest.mark.parametrize("estimator", BOTH)
def test_a_loss_that_nobody_noticed_is_told_by_what_does_not_fit(estimator: Estimator) -> None:
    recording = take(estimator)
    held = lost(recording, "foot_l", 20.0, 20.5).sensors["foot_l"]
    unnoticed = replace(held, valid=recording.sensors["foot_l"].valid)
    result = run(wearing(recording, foot_l=unnoticed), estimator)
    assert codes(result) & {"legs_do_not_fit", "zero_velocity_refused"}


@pytest.mark.sweep
@pytest.mark.parametrize("estimator", BOTH)
def test_a_burst_of_no_numbers_is_a_gap(estimator: Estimator) -> None:
    simulation = simulate_scenario("fast_with_turns", 3, worn=SEEN[estimator])
    device = next(d for d, s in simulation.recording.segments.items() if s == "foot_r")
    stream = simulation.recording.streams[device]
    assert stream.gyr is not None
    acc, gyr = stream.acc.copy(), stream.gyr.copy()
    acc[2000:2040], gyr[2000:2040] = np.nan, np.nan
    broken: Recording = replace(
        simulation.recording,
        streams={**simulation.recording.streams, device: replace(stream, acc=acc, gyr=gyr)},
    )
    done = analyse(broken, PipelineConfig(poses=PoseParams(estimator=estimator)))
    assert done.problem is None
    assert done.poses is not None
    assert "gap_not_bridged" in {n.code for n in done.notices}
    for segment in done.poses.p:
        assert np.isfinite(done.poses.p[segment]).all()
        assert np.isfinite(done.poses.q[segment]).all()
    assert done.angles is not None
    assert np.isnan(done.angles.angles["knee_flexion_r"][2005:2035]).all()


def test_a_number_that_is_none_inside_a_valid_sample_is_refused() -> None:
    calibrated = calibrate(take("l7s_3i"))
    orientations = estimate_orientations(calibrated)
    model = LegModel.of(BodyModel.from_height(1.75))
    acceleration = free_acceleration(calibrated, orientations)
    inputs = take_of(orientations, acceleration, still_feet(calibrated), model, "3I").part(slice(0, 60))
    acc: Floats = inputs.acc.copy()
    acc[37, 1, 2] = np.nan
    with pytest.raises(EstimationError) as error:
        filter_block(start_l7s_state(inputs, model), replace(inputs, acc=acc), model, 100.0)
    assert error.value.code == "bad_signal"
    assert "Sample 37" in error.value.message


@pytest.mark.parametrize("missing", ["pelvis", "foot_l", "foot_r"])
def test_a_missing_sensor_is_named(missing: Segment) -> None:
    recording = take("l7s_3i")
    retained = only(recording, *(s for s in PELVIS_FEET if s != missing))
    with pytest.raises(EstimationError) as requested_error:
        estimated(retained, PoseParams(estimator="l7s_3i"))
    assert requested_error.value.code == "estimator_impossible"
    calibrated = calibrate(recording)
    orientations = estimate_orientations(calibrated)
    without = replace(orientations, q={s: q for s, q in orientations.q.items() if s != missing})
    with pytest.raises(EstimationError) as settings:
        l7s_poses(
            without,
            free_acceleration(calibrated, without),
            still_feet(calibrated),
            BodyModel.from_height(1.75),
            configuration="3I",
        )
    assert (settings.value.code, settings.value.sensor) == ("sensor_missing", missing)


def test_a_take_without_its_pelvis_is_done_with_the_feet() -> None:
    estimate = estimated(only(take("l7s_3i"), *FEET))
    assert estimate.poses.method == "l7s_2i"


@pytest.mark.parametrize("name", ["hip_width", "thigh", "shank", "ankle_height", "foot"])
@pytest.mark.parametrize("length", [0.0, -0.1, np.nan, np.inf])
def test_a_length_that_no_leg_has_is_refused(name: str, length: float) -> None:
    with pytest.raises(EstimationError) as error:
        LegModel.of(replace(BodyModel.from_height(1.75), **{name: length}))  # type: ignore[arg-type]
    assert error.value.code == "segment_length"
    assert name in error.value.message


@pytest.mark.sweep
@pytest.mark.parametrize("estimator", BOTH)
def test_without_standing_there_is_an_error_or_a_notice(estimator: Estimator) -> None:
    walking = take(estimator, "comfortable")
    notices = codes(run(cut(walking, 8.0, 40.0), estimator))
    assert "started_moving" in notices
    with pytest.raises(SagittalError) as error:
        run(cut(walking, 8.0, 24.0), estimator)
    assert isinstance(error.value, EstimationError)
    assert error.value.code == "estimator_impossible"


@pytest.mark.sweep
@pytest.mark.parametrize("estimator", BOTH)
def test_a_treadmill_is_told_because_its_signals_are_those_of_the_floor(estimator: Estimator) -> None:
    result = run(replace(take(estimator), protocol="treadmill"), estimator)
    assert "treadmill_belt" in codes(result)


@pytest.mark.sweep
@pytest.mark.parametrize("estimator", BOTH)
@pytest.mark.parametrize("protocol", sweep_after(1, ["squat", "activity", "tug"]))
def test_a_protocol_in_which_the_pelvis_sinks_is_told(estimator: Estimator, protocol: str) -> None:
    result = run(replace(take(estimator), protocol=protocol), estimator)  # type: ignore[arg-type]
    assert "pelvis_height_assumed" in codes(result)


@pytest.mark.sweep
@pytest.mark.parametrize(("depth_m", "verdict"), [(0.0, "good"), (0.3, "bad")])
def test_a_squat_that_no_protocol_announced_is_told(depth_m: float, verdict: Verdict) -> None:
    recording = take("l7s_3i")
    calibrated = calibrate(recording)
    orientations = estimate_orientations(calibrated)
    acceleration: dict[Segment, SampleSeries] = {**free_acceleration(calibrated, orientations)}
    share = np.clip((recording.t_s - 2.0) / 3.0, 0.0, 1.0)
    sunk = depth_m * 64.0 * share**3 * (1.0 - share) ** 3
    down = np.gradient(np.gradient(sunk, 0.01), 0.01)
    acceleration["pelvis"] = acceleration["pelvis"][:] - down[:, None] * [0.0, 0.0, 1.0]
    body = simulated("fast_with_turns", 3)[1].body
    poses = l7s_poses(orientations, acceleration, still_feet(calibrated), body)
    # L7S pulls the pelvis back to its height: of 30 cm it shows few
    assert body.thigh + body.shank + body.ankle_height - poses.p["pelvis"][200:500, 2].min() < 0.1
    (result,) = (f for f in poses.health if f.name == "pelvis_rise_cm")
    assert result.verdict == verdict
    assert ("pelvis_rises" in {n.code for n in poses.notices}) == (depth_m > 0.0)


@pytest.mark.sweep
@pytest.mark.parametrize("name", sweep_after(1, ["slow", "fast_with_turns", "hemiparetic"]))
def test_the_rise_of_the_pelvis_is_the_true_one(name: str) -> None:
    recording, truth = simulated(name, 3)
    height = truth.p["pelvis"][:, 2]
    true = max(float(np.ptp(height[k : k + 300])) for k in range(0, len(height) - 300, 15))
    value, _ = finding(run(only(recording, *PELVIS_FEET), "l7s_3i"), "pelvis_rise_cm")
    assert value == pytest.approx(100.0 * true, abs=1.0)
