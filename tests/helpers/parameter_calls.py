"""Direct calls of functions of the chain, for parameters that no short take reaches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import permutations
from math import radians
from typing import Final

import numpy as np

from sagittal.core.agreement.exchange import judge_legs
from sagittal.core.agreement.labels import PATH, sort_by_joints
from sagittal.core.agreement.place_turns import PlaceStep, PlaceTurns, judge_turns
from sagittal.core.agreement.slips import question_strides
from sagittal.core.agreement.standings import StandingTurn, _has_slipped
from sagittal.core.agreement.terms import LevelMotion, find_terms
from sagittal.core.calibration.functional import find_functional_movements
from sagittal.core.calibration.table_top import calibrate_table_top
from sagittal.core.calibration.walking import moving_mask
from sagittal.core.events.detection import detect_contacts
from sagittal.core.events.foot_contact import FootContactState, advance_foot_contacts
from sagittal.core.events.gyro_peaks import gyro_peak_events
from sagittal.core.events.lumbar import _sides, detect_steps, find_step_times
from sagittal.core.events.turns import find_turns
from sagittal.core.frames import GRAVITY, Floats, Segment
from sagittal.core.pipeline import PipelineConfig
from sagittal.core.quality.stuck import mark_stuck
from sagittal.core.rotation import exp
from sagittal.core.setup.axes import fit_axes
from sagittal.core.signals.recording import SensorSignals, Subject, UniformRecording
from sagittal.core.signals.rest import drop_false_rests
from sagittal.core.squat.repetitions import find_repetitions
from tests.core.calibration.test_table_top import carried
from tests.core.events.foot_signal import foot_pitch, orientation, orientations
from tests.core.events.test_foot_contact import RATE, burst, moved, walk_pitch
from tests.core.events.test_gyro_peaks import shanks, swinging

T: Final[Floats] = np.arange(1500) / RATE


def refine_contacts(config: PipelineConfig) -> object:
    """Feet that hardly pitch, land on the toes, raise the heel slowly, or are not level."""
    t = T[:500]
    feet = [
        moved(t, 2.0, 0.6, 0.3, radians(60.0), 0.8),
        moved(t, 2.0, 0.6, 0.3, radians(60.0), 3.2),
        moved(t, 2.0, 1.9, 0.9, radians(170.0), 0.8),
        moved(t, 2.0, 0.6, 0.3, radians(90.0), 0.8, radians(16.0)),
        moved(t, 2.0, 0.6, 0.3, radians(60.0), 0.8, radians(1.5)),
        moved(t, 2.0, 0.6, 0.3, radians(60.0), 0.8, radians(4.0)),
    ]
    for rise, fall in ((0.0, 2.0), (0.0, 4.0), (4.5, 0.0), (6.0, 1.0), (9.0, 0.0)):
        # its toes go down as it leaves, and it slaps down without coming to rest
        q, speed, acc = moved(t, 2.0, 0.6, 0.3, radians(60.0), 0.8)
        pitch = (
            walk_pitch(t + 0.2, 1) - burst(t, 2.1, 0.08, radians(fall)) + burst(t, 2.2, 0.2, radians(fall))
        )
        pitch += burst(t, 2.2, 0.3, radians(rise)) - burst(t, 2.52, 0.08, radians(rise))
        restless = speed + np.abs(np.gradient(pitch, t)) + np.where((t > 2.1) & (t < 3.0), 0.6, 0.0)
        feet.append((orientation(pitch, burst(t, 2.0, 0.6, radians(60.0))), restless, acc))
    for angle in (8.0, 13.0, 20.0):
        slow = burst(t, 1.0, 2.0, radians(-angle)) + burst(t, 3.0, 0.4, radians(angle + 4.0))
        slow -= burst(t, 3.5, 0.9, radians(4.0))
        flat = np.tile([0.0, 0.0, GRAVITY], (len(t), 1))
        turning = np.where((t > 0.9) & (t < 4.5), 0.8, 0.0)
        feet.append((orientation(slow), turning + np.abs(np.gradient(slow, t)), flat))
    notices = []
    for q, speed, acc in feet:
        state = FootContactState.start(RATE, config.events, config.contacts)
        notices.append(advance_foot_contacts(state, q, np.ones(len(q), np.bool_), speed, acc))
    tilted: dict[Segment, Floats] = {
        "foot_l": foot_pitch(T, 2.0, 8, 1.1) - 0.3,
        "foot_r": foot_pitch(T, 2.0, 8, 1.1, 0.5) - 0.1,
    }
    return notices, detect_contacts(orientations(RATE, tilted), config.events, config.contacts)


def detect_swings(config: PipelineConfig) -> object:
    """Strong and weak swings on shanks and feet."""
    beat = np.where(np.floor(T) % 3 == 0, 0.3, 1.0)
    shaken = swinging(T) + 0.6 * swinging(T + 0.85) + 0.2 * np.sin(40.0 * T)
    knots = [0.0, 0.05, 0.15, 0.25, 0.35, 0.42, 0.5, 0.65, 0.7, 0.75, 1.0]
    values = [0.0, 0.0, -4.0, -0.2, -1.5, 0.0, 5.0, 0.0, -2.0, 0.0, 0.0]
    twice = np.interp(T % 1.0, knots, values) * ((T > 2.0) & (T < 12.0))
    results = []
    for rate in (
        swinging(T),
        shaken,
        twice,
        swinging(T) * beat,
        swinging(T) * (0.25 + 0.05 * T),
        swinging(0.7 * T),
    ):
        result = shanks(np.asarray(rate))
        q, valid = result.q["shank_l"], result.valid["shank_l"]
        limbs: tuple[Segment, ...] = ("shank_l", "shank_r", "foot_l", "foot_r")
        joint_variant = replace(result, q=dict.fromkeys(limbs, q), valid=dict.fromkeys(limbs, valid))
        for preset in config.consensus.gyro_peaks.by_name.values():
            results += [gyro_peak_events(joint_variant, RATE, preset)]
    return results


def follow_a_day_s_turns(config: PipelineConfig) -> object:
    """Turns of a trunk: quick and slow, cut in two, too small."""
    rate = np.zeros(len(T))
    for position, lasts, angle in (
        (1.0, 1.0, 50.0),
        (3.0, 2.0, 120.0),
        (6.0, 0.4, 60.0),
        (6.5, 0.4, 60.0),
        (8.0, 5.0, 170.0),
    ):
        inside = (position <= T) & (position + lasts > T)
        rate[inside] += radians(angle) / lasts * 2.0 * np.sin(np.pi * (T[inside] - position) / lasts) ** 2
    return find_turns(rate, np.ones(len(T), np.bool_), RATE, config.activity.turns)


def hear_legs(config: PipelineConfig) -> object:
    """Hips that hardly say which leg is which, and a pelvis that turns as much as a foot."""
    params = config.agreement.exchange
    misfits = {
        frozenset(x): 1.0 + 0.1 * abs(PATH.index(x[0]) - PATH.index(x[1])) for x in permutations(PATH, 2)
    }
    rates = {s: 1.0 + 0.2 * i for i, s in enumerate(PATH)}
    return judge_legs((), 1.2, -0.55, params), sort_by_joints(misfits, rates, params.calmest)


def hear_slips(config: PipelineConfig) -> object:
    """Places of one sensor that turn for good while another's turn less."""
    t, params = np.arange(40.0) * 3.0, config.agreement.slips
    noise = np.random.default_rng(1).normal(0.0, 0.01, (3, 40))
    turned = np.where(t > 60.0, 1.0, 0.0)
    places = np.ones((40, 2, 3))
    turns = {
        segment: PlaceTurns(t, size * turned + noise[i], places, 3.0)
        for i, (segment, size) in enumerate((("shank_l", 0.3), ("thigh_l", 0.1), ("foot_l", 0.0)))
    }
    return judge_turns(turns, 3.0, params)  # type: ignore[arg-type]


def hear_standings(config: PipelineConfig) -> object:
    """A shank with a different posture after the walk, and a slightly changed thigh."""
    ahead = np.array([1.0, 0.0, 0.0])
    turns = {
        "shank_l": StandingTurn(0.3, 0.3, ahead), "thigh_l": StandingTurn(0.1, 0.1, ahead),
        "shank_r": StandingTurn(0.0, 0.1, ahead), "thigh_r": StandingTurn(0.0, 0.1, ahead),
    }  # fmt: skip
    return [_has_slipped(s, turns, config.agreement.slips) for s in turns]  # type: ignore[arg-type]


def lose_samples(config: PipelineConfig) -> object:
    """A sensor that turns, and of which 0.3 s are missing."""
    gyr = np.stack((np.sin(T), 0.5 * np.cos(2.0 * T), 0.2 * np.sin(3.0 * T)), axis=1)
    acc = np.array([0.0, 0.0, GRAVITY]) + 2.0 * gyr
    valid = np.abs(T - 8.0) > 0.15
    return find_terms(SensorSignals("A", acc, gyr, None, valid, ~valid), RATE, config.agreement.joints).M


def lie_on_a_table(config: PipelineConfig) -> object:
    """Sensors on a tilted table, touched at the start of the trial."""
    params, take = config.squat.table_top, carried()
    until = round(0.9 * take.rate_hz)
    shaken = {}
    for s, x in take.sensors.items():
        gyr = np.array(x.gyr)
        gyr[:until:2] += 0.5
        shaken[s] = x.change(gyr=gyr)
    turned = (params.table[0], 0.0, 0.0, 1.0)
    level = calibrate_table_top(take, replace(params, table=turned))
    return level, calibrate_table_top(replace(take, sensors=shaken), params)


def lift_a_foot(config: PipelineConfig) -> object:
    """A knee that bends while its foot is off the floor for a quarter of the time."""
    knee = radians(60.0) * np.sin(np.pi * np.clip((T - 5.0) / 4.0, 0.0, 1.0)) ** 2
    return find_repetitions(knee, T, "left", None, config.squat.repetitions, np.abs(T - 7.0) > 0.45)


def sway_while_standing(config: PipelineConfig) -> object:
    """A standing of 4 s over which the vertical turns by 3°."""
    tilt = radians(3.0) * np.clip(T / 2.0, 0.0, 1.0)
    acc = GRAVITY * np.stack((np.sin(tilt), np.zeros(len(T)), np.cos(tilt)), axis=1)
    valid = np.ones(len(T), np.bool_)
    signals = SensorSignals("A", acc, np.zeros((len(T), 3)), None, valid, ~valid)
    take = UniformRecording(T, RATE, {"pelvis": signals}, Subject(), "walk", {})
    return drop_false_rests(take, ((0.0, 2.0), (5.0, 8.0)), config.calibration.rest)


def walk_in_pieces(segment: Segment, seed: int) -> UniformRecording:
    """A trunk that takes some steps, pauses, and continues at another pace."""
    rng, rate = np.random.default_rng(seed), 50.0
    phase, moving, position = [], [], 0.0
    for _ in range(8):
        step_s, steps = rng.uniform(0.45, 0.8), int(rng.choice((2, 3, 5, 7, 12, 25)))
        own = np.arange(round(steps * step_s * rate)) / (step_s * rate)
        own = own + rng.uniform(0.0, 0.12) * np.sin(rng.uniform(1.0, 3.0) * own)
        still = np.zeros(round(rng.choice((0.4, 0.9, 1.4, 2.5, 4.0)) * rate))
        phase += [position + own, position + steps + still]
        moving += [np.ones(len(own)), still]
        position += steps
    return make_trunk(segment, np.concatenate(phase), np.concatenate(moving), rng, rate)


def make_trunk(
    segment: Segment, turned: Floats, on: Floats, rng: np.random.Generator, rate: float
) -> UniformRecording:
    """A trunk that has made `turned` (n,) steps; on (n,) 1 while it walks."""
    n, noise = len(on), rng.normal(0.0, 0.15, (6, len(on)))
    lateral = 0.6 * on * np.sin(np.pi * turned)
    acc = np.stack((lateral, 0.3 * lateral, GRAVITY + 2.0 * on * np.cos(2.0 * np.pi * turned)), axis=1)
    gyr = (
        np.stack((0.2 * lateral, 0.0 * lateral, 0.5 * on * np.cos(np.pi * turned)), axis=1)
        + 0.2 * noise[:3].T
    )
    if segment == "chest":
        gyr = np.zeros((n, 3))
    valid, t_s = np.ones(n, np.bool_), np.arange(n) / rate
    signals = SensorSignals("A", acc + noise[3:].T, gyr, None, valid, ~valid)
    return UniformRecording(t_s, rate, {segment: signals}, Subject(), "walk", {})


def step_with_a_pelvis(config: PipelineConfig) -> object:
    """Steps of a pelvis with pauses."""
    return [detect_steps(walk_in_pieces("pelvis", seed), config.lumbar) for seed in range(8)]


def step_in_a_day(config: PipelineConfig) -> object:
    """The same of the monitor of daily life."""
    params = config.activity.steps
    takes = [walk_in_pieces("chest", seed) for seed in range(8)]
    for hurry in (0.02, 0.04, 0.06):
        t_s = np.arange(700) / 50.0
        turned = np.log1p(hurry * t_s / 0.7) / hurry
        takes.append(make_trunk("chest", np.asarray(turned), np.ones(700), np.random.default_rng(9), 50.0))
    return [find_step_times(x, "chest", params) for x in takes]


def question_slips(config: PipelineConfig) -> object:
    """Rotations without confirmation by strides, and one contradicted by them."""
    params, values = config.agreement.slips, np.array([0.0, 1.0, 0.0])
    swing = np.stack((0.0 * T, 3.0 * np.sin(2.0 * np.pi * T), 0.0 * T), axis=1)
    q = exp(np.stack((0.0 * T, (3.0 - 3.0 * np.cos(2.0 * np.pi * T)) / (2.0 * np.pi), 0.0 * T), axis=1))
    motion = LevelMotion(q, np.tile([[0.0], [0.0], [GRAVITY]], len(T)), swing)
    valid = np.ones(len(T), np.bool_)
    small, large = PlaceStep(7.0, radians(9.5), 5.0, 0.03), PlaceStep(7.0, radians(15.0), 20.0, 0.01)
    requests: tuple[tuple[PlaceStep, dict[Segment, LevelMotion]], ...] = (
        (small, {}),
        (large, {"shank_l": motion}),
    )
    return [
        question_strides("shank_l", step, values, motions, valid, RATE, 3.0, params)
        for step, motions in requests
    ]


def watch_sensors(config: PipelineConfig) -> object:
    """A rotating sensor, one with a stuck axis, and one that repeats a sample close to rest.

    The second also leaves a repeated rest as if rotating, and repeats a moving sample.
    """
    noise = np.random.default_rng(4).normal(0.0, 0.02, (4, len(T), 3))
    valid = np.ones(len(T), np.bool_)
    turning, frozen = noise[0], noise[1]
    turning[:, 0] += 2.0 * np.sin(3.0 * T)
    turning[300:, 1] = 0.011
    frozen[600:690] = 0.1
    frozen[500:504], frozen[504, 0] = 0.02, 3.0
    frozen[550:553] = 2.0
    acc = np.array([0.0, 0.0, GRAVITY]) + noise[2:]
    acc[1, 600:690] = (0.0, 0.0, GRAVITY + 1.0)
    acc[1, 500:504] = acc[1, 550:553] = (0.0, 0.0, GRAVITY)
    segments: dict[Segment, SensorSignals] = {
        "shank_l": SensorSignals("A", acc[0], turning, None, valid, ~valid),
        "shank_r": SensorSignals("B", acc[1], frozen, None, valid, ~valid),
    }
    stuck = mark_stuck(UniformRecording(T, RATE, segments, Subject(), "walk", {}), config.stuck)
    return stuck.notices, {s: x.valid for s, x in stuck.sensors.items()}


def compare_axes(config: PipelineConfig) -> object:
    """A sensor that hardly turns between two rests."""
    noise = np.random.default_rng(5).normal(0.0, 0.005, (2, len(T), 3))
    gyr, valid = noise[0], np.ones(len(T), np.bool_)
    gyr[400:1100, 2] += 0.3
    signals = SensorSignals("A", np.array([0.0, 0.0, GRAVITY]) + noise[1], gyr, None, valid, ~valid)
    return fit_axes(signals, RATE, config.setup)


def move_without_legs(config: PipelineConfig) -> object:
    """A trunk that moves more and more."""
    take = walk_in_pieces("pelvis", 1)
    return moving_mask(take, config.calibration.walking)


def pause_between_swings(config: PipelineConfig) -> object:
    """One leg swings, pauses and swings again while the other is still."""
    swings = np.where(((T > 2.0) & (T < 6.5)) | ((T > 9.0) & (T < 13.0)), 1.5, 0.0) * np.sin(5.0 * T)
    valid, still = np.ones(len(T), np.bool_), np.zeros((len(T), 3))
    rates = np.stack((0.0 * T, swings, 0.0 * T), axis=1)
    segments: dict[Segment, SensorSignals] = {
        "thigh_l": SensorSignals("A", still + GRAVITY, rates, None, valid, ~valid),
        "thigh_r": SensorSignals("B", still + GRAVITY, still, None, valid, ~valid),
    }
    take = UniformRecording(T, RATE, segments, Subject(), "walk", {})
    return find_functional_movements(take, config.calibration.functional)


def tell_feet_beside_turns(config: PipelineConfig) -> object:
    """A pelvis that turns in its first steps and again midway, where a step is missed."""
    steps = np.arange(24) * 0.5 + 1.0
    sign = np.where(T < 7.0, 1.0, -1.0)
    yaw = 0.12 * sign * np.cos(2.0 * np.pi * (T - 1.125))
    turning = np.where((T < 2.4) | (np.abs(T - 7.0) < 0.7), 1.0, 0.0)
    return [
        _sides(steps.tolist(), np.gradient(yaw, T) + turning * size, 0.5, RATE, config.lumbar)
        for size in (0.6, 1.0, 2.0)
    ]


CALLS: Final[dict[str, Callable[[PipelineConfig], object]]] = {
    f.__name__: f
    for f in (
        compare_axes,
        detect_swings,
        follow_a_day_s_turns,
        hear_legs,
        hear_slips,
        hear_standings,
        lie_on_a_table,
        lift_a_foot,
        lose_samples,
        move_without_legs,
        pause_between_swings,
        question_slips,
        refine_contacts,
        step_in_a_day,
        step_with_a_pelvis,
        sway_while_standing,
        tell_feet_beside_turns,
        watch_sensors,
    )
}
"""Name → call; a row of the table names it as its take, with the stage `call`."""
