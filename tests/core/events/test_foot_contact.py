"""Contacts of a foot whose moments of contact are known exactly, as a file and as a stream."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.events.detection import detect_contacts
from sagittal.core.events.foot_contact import (
    ContactReports,
    FootContactParams,
    FootContactState,
    advance_foot_contacts,
)
from sagittal.core.events.foot_movement import FootMovement, measure_foot_movements
from sagittal.core.events.live_contacts import ContactDetector
from sagittal.core.events.result import GaitEvent
from sagittal.core.frames import FOOT, GRAVITY, SIDES, Floats
from sagittal.core.rotation import conjugate, rotate
from tests.core.events.foot_signal import foot_pitch, orientation, orientations

RATE = 100.0
REST_S = 1.0
PUSH_S, SWING_S, SLAP_S = 0.2, 0.4, 0.1
"""Durations of the three bursts of pitch rate, each a squared sine: down, up, down to level."""
STRIDE_S = 1.1


def burst(t: Floats, start: float, length: float, angle: float) -> Floats:
    """Angle turned by a squared sine of the rate that starts at `start` and turns by `angle` in all."""
    x = np.clip((t - start) / length, 0.0, 1.0)
    return np.asarray(angle * (x - np.sin(2 * np.pi * x) / (2 * np.pi)))


def walk_pitch(t: Floats, strides: int) -> Floats:
    """Pitch of strides one after another: push-off to −50°, swing to +20°, slap to level."""
    p = np.zeros_like(t)
    for n in range(strides):
        s = REST_S + n * STRIDE_S
        p += burst(t, s, PUSH_S, np.radians(-50.0))
        p += burst(t, s + PUSH_S, SWING_S, np.radians(70.0))
        p += burst(t, s + PUSH_S + SWING_S, SLAP_S, np.radians(-20.0))
    return p


def true_moments(strides: int, params: FootContactParams) -> tuple[Floats, Floats]:
    """Foot-offs and contacts of `walk_pitch` by their definition: shares of the squared sines."""
    start = REST_S + np.arange(strides) * STRIDE_S
    back = 1.0 - np.arcsin(np.sqrt(params.leaving_share)) / np.pi
    down = np.arcsin(np.sqrt(params.contact_share)) / np.pi
    return np.asarray(start + back * PUSH_S), np.asarray(start + PUSH_S + SWING_S + down * SLAP_S)


def joined(parts: list[ContactReports]) -> list[tuple[int, int, int, bool, float, float]]:
    return [row for part in parts for row in zip(*(x.tolist() for x in part), strict=True)]


def moved(
    t: Floats,
    start: float,
    seconds: float,
    metres: float,
    turn: float,
    pitched_at: float | None = None,
    toes_down: float = 0.0,
) -> tuple[Floats, Floats, Floats]:
    """Orientations, speed and specific force of a flat foot that turns about the vertical and goes aside.

    At `pitched_at` an ordinary swing begins. The foot lands with its toes `toes_down`.
    """
    pitch = np.zeros_like(t) if pitched_at is None else walk_pitch(t - pitched_at + REST_S, 1)
    pitch += burst(t, start + 0.45 * seconds, 0.5 * seconds, -toes_down)
    pitch += burst(t, start + 0.95 * seconds, 0.05 * seconds, toes_down)
    heading = burst(t, start, seconds, turn)
    q = orientation(pitch, heading)
    x = np.clip((t - start) / seconds, 0.0, 1.0)
    away = metres * 2 * np.pi / seconds**2 * np.sin(2 * np.pi * x) * ((x > 0) & (x < 1))
    force = np.stack([away, np.zeros_like(t), np.full_like(t, GRAVITY)], axis=1)
    return q, np.abs(np.gradient(heading, t)) + np.abs(np.gradient(pitch, t)), rotate(conjugate(q), force)


@pytest.mark.parametrize("rate_hz", [60.0, 100.0, 204.8])
def test_contact_and_foot_off_are_at_their_shares_of_slap_and_push_off(rate_hz: float) -> None:
    params, strides = FootContactParams(), 6
    t = np.arange(round((2 * REST_S + strides * STRIDE_S) * rate_hz)) / rate_hz
    found = detect_contacts(orientations(rate_hz, {"foot_l": walk_pitch(t, strides)}))
    tc, ic = true_moments(strides, params)
    np.testing.assert_allclose(found.times("left", "tc"), tc, atol=0.5 / rate_hz)
    np.testing.assert_allclose(found.times("left", "ic"), ic, atol=0.5 / rate_hz)
    for e in found.events:
        assert e.uncertainty_s is not None
        least = params.contact_sd_s if e.kind == "ic" else params.leaving_sd_s
        assert least <= e.uncertainty_s < 0.04
    told = [e for e in found.events if e.kind == "ic"]
    assert all(e.first_s is not None and e.first_s != e.time_s for e in told), "first the pitch rule's moment"
    assert all(e.first_s is None for e in found.events if e.kind == "tc"), "a foot-off is refined when told"


@pytest.mark.parametrize("block", [1, 3, 64])
def test_a_stream_gives_the_same_bits_as_the_file_and_the_refined_time_soon(block: int) -> None:
    t = np.arange(1500) / RATE
    q = orientation(foot_pitch(t, 2.0, 8, 1.1))
    noise = np.random.default_rng(3)
    speed, acc = np.abs(noise.normal(1.0, 1.0, len(t))), noise.normal(0.0, 5.0, (len(t), 3))
    valid = np.ones(len(t), np.bool_)
    valid[600:640] = False
    whole = joined([advance_foot_contacts(FootContactState.start(RATE), q, valid, speed, acc)])
    state = FootContactState.start(RATE)
    parts = []
    for k in range(0, len(t), block):
        part = slice(k, k + block)
        told = advance_foot_contacts(state, q[part], valid[part], speed[part], acc[part])
        assert ((told.known >= k) & (told.known < k + block)).all(), "told in the block in which it is known"
        parts.append(told)
    assert joined(parts) == whole
    first = {n: known for kind, n, known, last, *_ in whole if kind == 1 and not last}
    refined = {n: known for kind, n, known, last, *_ in whole if kind == 1 and last}
    assert len(first) >= 6
    assert all(refined[n] - known <= FootContactParams().contact_s * RATE for n, known in first.items())


@pytest.mark.parametrize("pitched_at", [0.8, 3.2])
def test_a_foot_that_steps_without_pitching_is_found_by_its_movement(pitched_at: float) -> None:
    """A last step is told after a pitched swing, a first one when the next tells that it was walking."""
    t = np.arange(500) / RATE
    q, speed, acc = moved(t, 2.0, 0.6, 0.3, np.radians(60.0), pitched_at)
    told = advance_foot_contacts(FootContactState.start(RATE), q, np.ones(len(t), np.bool_), speed, acc)
    own = [i for i, at in enumerate(told.at / RATE) if 1.9 < at < 2.9]
    tc, ic = own
    assert told.kind[own].tolist() == [0, 1]
    assert 2.0 < told.at[tc] / RATE < 2.3
    assert 2.3 < told.at[ic] / RATE < 2.7
    assert (told.uncertainty_s[own] >= FootContactParams().loose_sd_s).all()
    assert (told.known[ic] / RATE < 2.8) == (pitched_at < 2.0)
    assert len(told.kind) == 5, "and the pitched swing, its contact told twice"


def test_a_gait_without_any_pitched_swing_is_not_told_by_halves() -> None:
    t = np.arange(500) / RATE
    q, speed, acc = moved(t, 2.0, 0.6, 0.3, np.radians(60.0))
    assert not len(advance_foot_contacts(FootContactState.start(RATE), q, t >= 0.0, speed, acc).kind)


@pytest.mark.parametrize("block", [1, 7, 1200])
@pytest.mark.parametrize(
    ("pauses", "expected"), [((0.6, 0.6, 0.7), 4), ((0.6, 1.3, 0.5), 0), ((3.5, 3.5, 3.5), 0)]
)
def test_even_steps_without_pitch_are_a_gait(pauses: tuple[float, ...], expected: int, block: int) -> None:
    """A paretic foot swung without pitch for 48 s, and nothing of it was found."""
    steps = [
        moved(np.arange(round(100 * (0.6 + pause))) / RATE, 0.0, 0.6, 0.5, np.radians(60.0))
        for pause in pauses
    ]
    still = moved(np.arange(60) / RATE, 10.0, 0.6, 0.5, np.radians(60.0))
    last = moved(np.arange(120) / RATE, 0.0, 0.6, 0.5, np.radians(60.0))
    q, speed, acc = (np.concatenate(parts) for parts in zip(still, *steps, last, strict=True))
    state, told = FootContactState.start(RATE), []
    for k in range(0, len(q), block):
        part = slice(k, k + block)
        told.append(
            advance_foot_contacts(state, q[part], np.ones(len(q[part]), np.bool_), speed[part], acc[part])
        )
    assert np.concatenate([x.kind for x in told]).tolist() == [0, 1] * expected
    assert (np.diff(np.concatenate([x.at for x in told])) > 0).all()
    assert np.concatenate([x.number for x in told]).tolist() == list(range(2 * expected))


def test_pieces_of_a_slow_swing_are_no_steps() -> None:
    """In a severe shuffle the push and the landing alone are faster than the limit of rest."""
    step = moved(np.arange(160) / RATE, 0.2, 0.28, 0.5, np.radians(60.0))
    q, speed, acc = (np.concatenate([x] * 6) for x in step)
    assert not len(advance_foot_contacts(FootContactState.start(RATE), q, speed >= 0.0, speed, acc).kind)


@pytest.mark.parametrize(("metres", "turn"), [(0.02, 60.0), (0.3, 10.0)])
def test_a_shift_on_the_spot_and_a_slow_slide_are_no_steps(metres: float, turn: float) -> None:
    t = np.arange(400) / RATE
    q, speed, acc = moved(t, 2.0, 0.6, metres, np.radians(turn), 0.8)
    told = advance_foot_contacts(FootContactState.start(RATE), q, np.ones(len(t), np.bool_), speed, acc)
    assert len(told.kind) == 3, "the pitched swing alone"


@pytest.mark.parametrize("block", [1, 7, 500])
def test_a_foot_off_that_was_the_landing_of_a_step_is_told_again(block: int) -> None:
    """A foot that turns and comes down on its toes is lowest as it lands: so short is no swing."""
    params = FootContactParams()
    t = np.arange(500) / RATE
    q, speed, acc = moved(t, 2.0, 0.6, 0.3, np.radians(90.0), 0.8, np.radians(16.0))
    told = advance_foot_contacts(FootContactState.start(RATE), q, t >= 0.0, speed, acc)
    wrong, mended = (i for i, kind in enumerate(told.kind) if kind == 0 and told.known[i] > 2.0 * RATE)
    assert told.number[wrong] == told.number[mended]
    assert told.at[wrong] / RATE > 2.4
    assert 2.0 < told.at[mended] / RATE < 2.3
    assert told.uncertainty_s[mended] >= params.loose_sd_s
    here = replace(orientations(RATE, {"foot_l": t}), q={"foot_l": q})
    whole = detect_contacts(here, motions={"foot_l": FootMovement(speed, acc)})
    assert [e.kind for e in whole.events] == ["tc", "ic", "tc", "ic"], "each once, at its last time"
    detector = ContactDetector(("foot_l",), RATE)
    streamed: dict[float, GaitEvent] = {}
    for k in range(0, len(t), block):
        part = slice(k, k + block)
        motion = FootMovement(speed[part], acc[part])
        for x in detector.push(q[part, None], np.ones((len(t[part]), 1), np.bool_), [motion], 0):
            assert x.final or x.event.kind == "ic"
            streamed[x.event.first_s or x.event.time_s] = x.event
    assert sorted(streamed.values(), key=lambda e: e.time_s) == list(whole.events)


def test_a_heel_that_is_raised_and_held_is_no_foot_off() -> None:
    t = np.arange(500) / RATE
    held = burst(t, 0.3, 0.8, np.radians(-13.0)) + burst(t, 1.2, 0.4, np.radians(-1.0))
    held += burst(t, 1.6, 0.3, np.radians(1.0)) - burst(t, 3.2, 0.3, np.radians(-13.0))
    pitch = held + walk_pitch(t - 2.5 + REST_S, 1)
    speed, acc = np.abs(np.gradient(pitch, t)), np.tile([0.0, 0.0, GRAVITY], (len(t), 1))
    assert speed[110:190].max() < FootContactParams().still_rad_s
    q = orientation(pitch)
    assert advance_foot_contacts(FootContactState.start(RATE), q, t >= 0.0).at[0] / RATE < 1.7, (
        "by pitch alone"
    )
    told = advance_foot_contacts(FootContactState.start(RATE), q, t >= 0.0, speed, acc)
    assert told.kind.tolist() == [0, 1, 1]
    assert told.at[0] / RATE == pytest.approx(2.5 + PUSH_S, abs=0.1)


def test_a_sensor_lost_in_the_window_ends_the_wait_for_the_refined_time() -> None:
    t = np.arange(round(3.2 * RATE)) / RATE
    q = orientation(walk_pitch(t, 1))
    whole = advance_foot_contacts(FootContactState.start(RATE), q, np.ones(len(t), np.bool_))
    (first,) = whole.known[(whole.kind == 1) & ~whole.last]
    valid = np.ones(len(t), np.bool_)
    valid[first + 2 :] = False
    cut = advance_foot_contacts(FootContactState.start(RATE), q, valid)
    assert cut.known[-1] == first + 2
    assert cut.last[-1]
    ended = advance_foot_contacts(FootContactState.start(RATE), q[: first + 2], valid[: first + 2])
    assert not ended.last[-1], "at the end of a take the first time stands"


def test_a_flat_landing_is_where_the_foot_stops_turning_and_less_certain() -> None:
    params = FootContactParams()
    t = np.arange(round(4.0 * RATE)) / RATE
    pitch = burst(t, 1.0, PUSH_S, np.radians(-50.0)) + burst(t, 1.0 + PUSH_S, SWING_S, np.radians(50.0))
    pitch += np.radians(2.0) * np.clip(t - 1.6, 0.0, 0.5)
    pitch -= np.radians(2.0) * np.clip(t - 2.1, 0.0, 1.0)
    told = advance_foot_contacts(FootContactState.start(RATE), orientation(pitch), np.ones(len(t), np.bool_))
    assert told.kind[-1] == 1
    assert told.at[-1] / RATE == pytest.approx(1.6, abs=0.08), "the highest pitch is half a second later"
    assert told.uncertainty_s[-1] == params.flat_sd_s


def test_motion_of_the_feet_is_without_bias_and_in_their_axes() -> None:
    from sagittal.core import calibration
    from tests.helpers.walks import simulated

    calibrated = calibration.calibrate(simulated()[0])
    motions = measure_foot_movements(calibrated)
    start, end = (round(x * RATE) for x in calibrated.calibration.zero)
    for side in SIDES:
        motion = motions[FOOT[side]].cut(slice(start, end))
        assert motion.speed.mean() < 0.05
        np.testing.assert_allclose(motion.acc.mean(axis=0), [0.0, GRAVITY, 0.0], atol=0.15)
