"""Headings of the ErKF: what no sensor tells is not learned, what the joints tell is found from far off."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import degrees, radians

import numpy as np
import pytest

from sagittal.core.body.erkf.filter import ErkfState, ErkfTrack, filter_block
from sagittal.core.body.erkf.health import START_HEADING_DEG, erkf_health, erkf_notices
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.erkf.poses import ErkfRun
from sagittal.core.body.erkf.smoother import smooth
from sagittal.core.body.erkf.start import start_state
from sagittal.core.frames import Floats
from sagittal.core.rotation import about, multiply, rotate, to_matrix, yaw
from tests.core.body.erkf.walks import SEGMENTS, Take, angles_of, mixed_walk

LIVE, OFFLINE = ErkfParams.live(), ErkfParams.offline()
TOE_OFF_S = 6.5
LATE_S = 25.0


def turned_start(by_deg: dict[int, float], params: ErkfParams) -> ErkfState:
    """The standing start, orientations true but for some headings, positions laid out with them."""
    take = mixed_walk()
    q = np.stack([multiply(take.truth.q[s][0], take.tree.q_mount[i]) for i, s in enumerate(SEGMENTS)])
    for i, angle in by_deg.items():
        q[i] = multiply(about(2, radians(angle)), q[i])
    return start_state(take.tree, take.inputs, params, take.rest, q=q)


def alternately(angle_deg: float) -> dict[int, float]:
    """Every second sensor to the left, the others to the right: neighbours twice as far apart."""
    return {i: angle_deg if i % 2 else -angle_deg for i in range(len(SEGMENTS))}


def apart_deg(take: Take, track: ErkfTrack) -> Floats:
    """Largest error (n,) of a sensor's heading against the pelvis'."""
    q = take.tree.segment_q(track.q)
    off = np.stack([yaw(q[:, i]) - yaw(take.truth.q[s][: len(q)]) for i, s in enumerate(SEGMENTS)])
    return np.asarray(np.degrees(np.abs(np.angle(np.exp(1j * (off - off[0]))))).max(axis=0))


def relative_sd_deg(state: ErkfState, m: int) -> Floats:
    """What the filter gives as uncertainty of each joint's relative heading."""
    up = to_matrix(state.nominal[:, 6:10])[:, 2]
    result = []
    for joint in mixed_walk().tree.joints:
        row = np.zeros(len(state.P))
        for i, sign in ((joint.proximal, 1.0), (joint.distal, -1.0)):
            row[i * m + 6 : i * m + 9] = sign * up[i]
        result.append(degrees(float(np.sqrt(row @ state.P @ row))))
    return np.array(result)


@cache
def smoothed(angle_deg: float) -> ErkfRun:
    """The sensor of the right foot turned by so much, through the smoother."""
    take = mixed_walk()
    foot = SEGMENTS.index("foot_r")
    start = turned_start({foot: angle_deg}, OFFLINE)
    track, final = smooth(start, take.inputs, take.tree, OFFLINE)
    return ErkfRun(take.tree, take.inputs, start, take.rest, track, final)


@pytest.mark.parametrize("params", [LIVE, OFFLINE], ids=["live", "offline"])
def test_standing_tells_nothing_of_headings(params: ErkfParams) -> None:
    """Joints of a person who stands fit together with any headings; neither these nor their uncertainty may
    move. Positions and orientations taken as independent at the start gave 18° in place of 42°."""
    take = mixed_walk()
    first = turned_start(alternately(60.0), params)
    final_block = filter_block(first, take.inputs.part(0, 500), take.tree, params)[1]
    before_deg, after_deg = relative_sd_deg(first, params.states), relative_sd_deg(final_block, params.states)
    np.testing.assert_allclose(before_deg, degrees(np.sqrt(2.0) * params.start_heading_sd), rtol=0.01)
    assert (after_deg > 0.9 * before_deg).all()


def test_the_heading_that_all_have_in_common_is_taken_as_known() -> None:
    take = mixed_walk()

    def common_sd_deg(state: ErkfState) -> float:
        up = to_matrix(state.nominal[:, 6:10])[:, 2]
        row = np.zeros(len(state.P))
        for i in range(len(SEGMENTS)):
            row[i * 9 + 6 : i * 9 + 9] = up[i] / len(SEGMENTS)
        return degrees(float(np.sqrt(row @ state.P @ row)))

    free = start_state(take.tree, take.inputs, LIVE, take.rest)
    measured = replace(take.inputs, heading=np.full(take.inputs.valid.shape, np.nan))
    assert common_sd_deg(free) < 0.5
    assert common_sd_deg(start_state(take.tree, measured, LIVE, take.rest)) > 10.0, "a magnetometer tells it"
    final_block = filter_block(free, take.inputs, take.tree, LIVE)[1]
    assert common_sd_deg(final_block) > common_sd_deg(free), "and it is not learned on the way"


def test_a_common_turn_of_the_start_changes_no_joint_angle() -> None:
    take = mixed_walk()
    first = start_state(take.tree, take.inputs, LIVE, take.rest)
    turn = about(2, 0.9)
    nominal = first.nominal.copy()
    nominal[:, 0:3] = rotate(turn, nominal[:, 0:3])
    nominal[:, 6:10] = multiply(turn, nominal[:, 6:10])
    P = first.P.copy()
    spin = to_matrix(turn)
    for i in range(len(SEGMENTS)):
        for position in (0, 3):
            k = slice(i * 9 + position, i * 9 + position + 3)
            P[k] = spin @ P[k]
            P[:, k] = P[:, k] @ spin.T
    one = filter_block(first, take.inputs, take.tree, LIVE)[0]
    other_block = filter_block(replace(first, nominal=nominal, P=P), take.inputs, take.tree, LIVE)[0]
    a, b = angles_of(take, one), angles_of(take, other_block)
    for name in a:
        if not name.startswith("pelvis"):
            assert np.degrees(np.abs(a[name] - b[name]).max()) < 1e-6, name


@pytest.mark.slow
@pytest.mark.parametrize("params", [LIVE, OFFLINE], ids=["live", "offline"])
@pytest.mark.parametrize(("angle", "within_1s", "left"), [(30.0, 3.0, 1.1), (60.0, 6.0, 2.0)])
def test_headings_that_start_apart_come_together(
    params: ErkfParams, angle: float, within_1s: float, left: float
) -> None:
    """Neighbours 60° and 120° apart, the start's deviation as large as the error."""
    take = mixed_walk()
    wide = replace(params, start_heading_sd=radians(60.0))
    first = turned_start(alternately(angle), wide)
    track = filter_block(first, take.inputs, take.tree, wide)[0]
    error = apart_deg(take, track)
    assert error[round(TOE_OFF_S * take.rate_hz) - 100] > 0.9 * 2 * angle
    assert error[round((TOE_OFF_S + 1.0) * take.rate_hz)] < within_1s
    assert error[round(LATE_S * take.rate_hz) :].max() < left
    smooth_error = apart_deg(take, smooth(first, take.inputs, take.tree, wide)[0])
    assert np.sqrt(np.mean(smooth_error[round(TOE_OFF_S * take.rate_hz) :] ** 2)) < 1.5


@pytest.mark.slow
@pytest.mark.parametrize("params", [LIVE, OFFLINE], ids=["live", "offline"])
@pytest.mark.parametrize(("angle", "sd"), [(30.0, 30.0), (60.0, 30.0), (60.0, 90.0), (90.0, 90.0)])
def test_with_known_positions_they_come_together_at_the_first_step(
    params: ErkfParams, angle: float, sd: float
) -> None:
    """docs/science/erkf.md, "Limits on simulated walks": below 3° within 1 s of the first toe-off, positions
    given."""
    take = mixed_walk()
    wide = replace(params, start_heading_sd=radians(sd))
    start = turned_start(alternately(angle), wide)
    nominal, P, m = start.nominal.copy(), np.zeros_like(start.P), wide.states
    nominal[:, 0:3] = [
        take.truth.p[s][0] + rotate(take.truth.q[s][0], take.tree.place[i]) for i, s in enumerate(SEGMENTS)
    ]
    for position in range(0, len(P), 3):
        k = slice(position, position + 3)
        P[k, k] = start.P[k, k] if position % m else wide.start_position_sd**2 * np.eye(3)
    first = replace(start, nominal=nominal, P=P)
    error = apart_deg(take, filter_block(first, take.inputs, take.tree, wide)[0])
    assert error[round((TOE_OFF_S + 0.6) * take.rate_hz) :].max() < 3.0


def test_a_measured_heading_holds_the_common_one_and_leaves_angles_alone() -> None:
    """The pelvis' heading five times a second with 10° of noise, as from a magnetometer, in a take that
    starts facing 20° off it."""
    take, rng = mixed_walk(), np.random.default_rng(8)
    true = yaw(take.truth.q["pelvis"][: len(take.inputs.step_s)])
    heading = np.full(take.inputs.valid.shape, np.nan)
    heading[::20, 0] = true[::20] + radians(10.0) * rng.standard_normal(len(true[::20]))
    aided = replace(take, inputs=replace(take.inputs, heading=heading))
    first = turned_start(dict.fromkeys(range(len(SEGMENTS)), 20.0), LIVE)
    q = first.nominal[:, 6:10]
    open_start = start_state(take.tree, aided.inputs, LIVE, take.rest, q=q)
    with_aid = filter_block(open_start, aided.inputs, take.tree, LIVE)[0]
    without = filter_block(first, take.inputs, take.tree, LIVE)[0]
    off = [np.degrees(yaw(take.tree.segment_q(t.q)[-500:, 0]) - true[-500:]) for t in (with_aid, without)]
    assert abs(np.angle(np.exp(1j * np.radians(off[0]))).mean()) < radians(5.0)
    assert abs(np.angle(np.exp(1j * np.radians(off[1]))).mean()) > radians(15.0)
    a, b = (angles_of(take, track, zeroed=False) for track in (with_aid, without))
    late = slice(round(LATE_S * take.rate_hz), None)
    for name in ("hip_flexion_l", "knee_flexion_r", "hip_rotation_r", "ankle_inversion_l"):
        assert np.degrees(np.abs((a[name] - b[name])[late]).max()) < 1.0, name


@pytest.mark.slow
@pytest.mark.parametrize("angle", [30.0, 60.0, 90.0])
def test_one_sensor_is_brought_back_from_up_to_ninety_degrees(angle: float) -> None:
    take = mixed_walk()
    error = apart_deg(take, smoothed(angle).track)
    assert np.sqrt(np.mean(error[round(TOE_OFF_S * take.rate_hz) :] ** 2)) < 2.0


@pytest.mark.slow
@pytest.mark.parametrize("angle", [0.0, 20.0, 60.0, 105.0, 150.0])
def test_a_start_that_was_off_is_told_with_its_size(angle: float) -> None:
    """The smoother's first heading against the one taken: right within 10°, even where poses are not."""
    run = smoothed(angle)
    health = erkf_health(run)
    (result,) = [f for f in health if f.name == "start_heading_off_deg"]
    assert result.value == pytest.approx(angle, abs=10.0)
    warn, bad = START_HEADING_DEG
    assert result.verdict == ("bad" if angle > bad else "warn" if angle > warn else "good")
    notices = [n for n in erkf_notices(run, health) if n.code == "start_heading_off"]
    assert bool(notices) == (angle > warn)
    if notices:
        assert notices[0].sensor == "foot_r"
        assert f"{result.value:.0f}°" in notices[0].message
