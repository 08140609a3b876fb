"""Short takes on which parameters matter: the usual walks, tests and days, and what goes wrong in them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import pi, radians
from typing import Final

import numpy as np

from sagittal.core.frames import Floats, Segment
from sagittal.core.pipeline import PipelineConfig
from sagittal.core.signals.recording import GivenLimits, Recording, UniformRecording
from sagittal.core.simulate import (
    SwingsAndBows,
    simulate,
    simulate_movement,
    simulate_scenario,
    simulate_swings_and_bows,
)
from sagittal.core.simulate.chest import ChestStyle, Day, PostureHold, simulate_day
from sagittal.core.simulate.daily import OFF, DailyItem, record_daily_life, simulate_daily_life
from sagittal.core.simulate.magnetics import Dipole
from sagittal.core.simulate.script import Arc, Script, Stand, Straight
from sagittal.core.simulate.scripts import ON_SKIN
from sagittal.core.simulate.setup import Dropout, Lag
from sagittal.core.simulate.standing import simulate_sway
from sagittal.core.simulate.tug import simulate_chair_rises, simulate_tug
from sagittal.core.simulate.walker import Walker
from sagittal.core.timeline import synchronise
from tests.helpers.parameter_calls import CALLS
from tests.helpers.parameter_changes import DirectCall, StagedTake, replace_value
from tests.helpers.perturbations import delay_sensor, find_middle, slip_sensor
from tests.helpers.setup_mistakes import TURNS, change_axes, exchange_labels
from tests.helpers.table_top import from_table

WALK: Final[Script] = (
    Stand(5.0), Straight(9.0, 0.64, 0.54), Arc(1.0, pi, 0.5, 0.56), Straight(7.0, 0.64, 0.54), Stand(3.0),
)  # fmt: skip
FEET: Final[tuple[Segment, ...]] = ("pelvis", "foot_l", "foot_r")


@dataclass(frozen=True)
class Take:
    """Definition of a trial with its non-default options (name → value)."""

    make: Callable[[], Recording]
    chosen: dict[str, object] = field(default_factory=dict)


def walk(script: Script = WALK, seed: int = 0, **setup: object) -> Recording:
    """Walk of the reference person, by default with seven sensors."""
    return simulate(script, Walker(), seed, replace(ON_SKIN, **setup)).recording  # type: ignore[arg-type]


def edit(recording: Recording, change: Callable[[UniformRecording], UniformRecording]) -> Recording:
    """Recording with modified sensors on the common axis, without lost samples."""
    uniform = change(synchronise(recording))
    segment_names = {s: d for d, s in recording.segments.items() if s is not None}
    streams = dict(recording.streams)
    for segment, x in uniform.sensors.items():
        stored_valid = x.valid
        streams[segment_names[segment]] = streams[segment_names[segment]].change(
            t_s=uniform.t_s[stored_valid],
            acc=x.acc[stored_valid],
            gyr=x.gyr[stored_valid],
            mag=None,
            quat=None,
        )
    return replace(recording, streams=streams)


def spoil(
    segment: Segment, change: Callable[[Floats, Floats], None], recording: Recording | None = None
) -> Recording:
    """A walk of which one sensor's acc and gyr (n, 3) are changed in place."""
    recording = walk() if recording is None else recording
    device = next(d for d, s in recording.segments.items() if s == segment)
    x = recording.streams[device]
    acc, gyr = np.array(x.acc), np.array(x.gyr)
    change(acc, gyr)
    return replace(recording, streams={**recording.streams, device: x.change(acc=acc, gyr=gyr, mag=None)})


def silence(a: Floats, first: int, last: int) -> None:
    """Hold the value of one sample."""
    a[first:last] = a[first]


def stick_axis(acc: Floats, gyr: Floats) -> None:
    """One axis of the gyroscope that shows one value."""
    gyr[900:, 1] = 0.013


def stick_rarely(acc: Floats, gyr: Floats) -> None:
    """An axis that shows a new value every tenth sample."""
    k = 900
    acc[k:, 2] = np.repeat(acc[k::10, 2], 10)[: len(acc) - k]


def freeze(acc: Floats, gyr: Floats) -> None:
    """A sensor that repeats one sample for a while."""
    silence(acc, 900, 1050)
    silence(gyr, 900, 1050)


def loop(acc: Floats, gyr: Floats) -> None:
    """The last packet of 20 samples, again and again."""
    second = 900 + np.arange(len(acc) - 900) % 20
    acc[900:], gyr[900:] = acc[second], gyr[second]


def clip(acc: Floats, gyr: Floats) -> None:
    """A gyroscope of too small a range."""
    limit = radians(250.0)
    gyr[:] = np.clip(gyr, -limit, limit)


def clip_force(acc: Floats, gyr: Floats) -> None:
    """An accelerometer of 2 g."""
    limit = 2.0 * 9.80665
    acc[:] = np.clip(acc, -limit, limit)


def roll(acc: Floats, gyr: Floats) -> None:
    """A foot that is never completely still."""
    acc[600:] *= 1.2


def slip(segment: Segment, by_deg: float, at_s: float | None = None, name: str = "comfortable") -> Recording:
    """A walk in which a sensor turns on its segment."""

    def turn(uniform: UniformRecording) -> UniformRecording:
        return slip_sensor(uniform, segment, radians(by_deg), find_middle(uniform) if at_s is None else at_s)

    return edit(simulate_scenario(name, 1).recording, turn)


def drift(segment: Segment, last_s: float) -> Recording:
    """A walk with one sensor whose clock loses time."""
    return edit(
        simulate_scenario("comfortable", 1).recording,
        lambda u: delay_sensor(u, segment, np.linspace(0.0, last_s, len(u.t_s))),
    )


def shorten(recording: Recording, start_s: float, end_s: float) -> Recording:
    """Every stream from one time to another."""
    streams = {}
    for device, x in recording.streams.items():
        retained = (x.t_s >= start_s) & (x.t_s < end_s)
        gyr = x.gyr if x.gyr is None else x.gyr[retained]
        streams[device] = x.change(t_s=x.t_s[retained], acc=x.acc[retained], gyr=gyr, mag=None, quat=None)
    return replace(recording, streams=streams)


def begin_late(recording: Recording, segment: Segment, start_s: float) -> Recording:
    """One sensor that begins later than the others."""
    device = next(d for d, s in recording.segments.items() if s == segment)
    late = shorten(replace(recording, streams={device: recording.streams[device]}), start_s, 1e9)
    return replace(recording, streams={**recording.streams, **late.streams})


def miss(recording: Recording, start_s: float, end_s: float) -> Recording:
    """Every stream without a part of it."""
    streams = {}
    for device, x in recording.streams.items():
        retained = (x.t_s < start_s) | (x.t_s >= end_s)
        gyr = x.gyr if x.gyr is None else x.gyr[retained]
        streams[device] = x.change(t_s=x.t_s[retained], acc=x.acc[retained], gyr=gyr, mag=None, quat=None)
    return replace(recording, streams=streams)


def declare(recording: Recording) -> Recording:
    """A walk whose mountings are written down, wrongly for some."""
    return replace(recording, mounting={s: "strap, x forward" for s in recording.segments.values() if s})


def detect_by(preset: str, recording: str = "healthy", **other: object) -> Take:
    """Contacts of one published detector alone."""
    segments = (
        ("pelvis", "foot_l", "foot_r")
        if preset in ("mariani", "perez_ibarra")
        else ("pelvis", "shank_l", "shank_r")
    )
    return Take(
        lambda: simulate_scenario(recording, 1, worn=segments).recording,  # type: ignore[arg-type]
        {"detector": "consensus", "consensus.presets": (preset,)}
        | {f"consensus.gyro_peaks.{preset}.{name}": value for name, value in other.items()},
    )


def live_a_day(*items: DailyItem, has_gyro: bool = True, seed: int = 5) -> Recording:
    """Daily life by a plan."""
    return record_daily_life(simulate_daily_life(items, 1.68, seed, 50.0, has_gyro=has_gyro))


DAY: Final = (
    DailyItem("stand", 10.0), DailyItem("walk", 30.0, 100.0), DailyItem("sit", 60.0),
    DailyItem("stand", 20.0), DailyItem("walk", 40.0), DailyItem("sit", 30.0), DailyItem("lie", 60.0),
    DailyItem("sit", 20.0),
    DailyItem("stand", 10.0), DailyItem("bow", 4.0), DailyItem("stand", 20.0), DailyItem("walk", 20.0),
    DailyItem("sit", 40.0),
)  # fmt: skip
CHAIR_DAY: Final[Day] = (
    PostureHold("stand", 6.0),
    *(PostureHold("sit", 4.0), PostureHold("stand", 4.0)) * 3,
    PostureHold("walk", 12.0),
    PostureHold("bow", 3.0),
    PostureHold("stand", 4.0),
    PostureHold("sit", 4.0),
    PostureHold("lie", 8.0),
    PostureHold("sit", 4.0),
    PostureHold("stand", 5.0),
)
PAUSES: Final[Script] = (
    Stand(4.0), Straight(6.4, 0.64, 0.54), Stand(1.2), Straight(3.2, 0.64, 0.54), Stand(2.2),
    Straight(1.92, 0.64, 0.54), Stand(0.7), Straight(6.4, 0.64, 0.54), Stand(3.5), Straight(5.12, 0.64, 0.8),
    Stand(3.0),
)  # fmt: skip
LEGS: Final[tuple[Segment, ...]] = ("pelvis", "shank_l", "shank_r")

TAKES: Final[dict[str, Take]] = {
    "walk": Take(walk),
    "feet": Take(lambda: walk(worn=FEET)),
    "lower_back": Take(lambda: walk(worn=("pelvis",))),
    "squat": Take(lambda: simulate_movement("squats_agreed", 1).recording),
    "squats_in_turn": Take(lambda: simulate_movement("squats_both_legs", 1).recording),
    "from_table": Take(from_table, {"squat.mounting": "table_top"}),
    "tug": Take(lambda: simulate_tug().recording),
    "chair": Take(lambda: simulate_chair_rises().recording),
    "sway": Take(lambda: replace(simulate_sway().recording, protocol="standing_eyes_open")),
    "lossy": Take(lambda: walk(packet_loss=0.05, dropouts=(Dropout("shank_r", 9.0, 12.0),))),
    "late_shank": Take(lambda: walk(lags=(Lag("shank_r", 0.04),))),
    "late_leg": Take(lambda: walk(lags=(Lag("thigh_l", 0.04), Lag("shank_l", 0.04), Lag("foot_l", 0.04)))),
    "late_foot": Take(lambda: walk(worn=FEET, lags=(Lag("foot_l", 0.05),))),
    "drifting_shank": Take(lambda: drift("shank_r", 0.04)),
    "slipped_shank": Take(lambda: slip("shank_r", 15.0, 17.0)),
    "slipped_turning": Take(lambda: slip("shank_r", 15.0, None, "fast_with_turns")),
    "exchanged_thighs": Take(lambda: exchange_labels(walk(), {"thigh_l": "thigh_r", "thigh_r": "thigh_l"})),
    "mirrored_force": Take(lambda: change_axes(walk(), "shank_l", acc=-np.eye(3))),
    "turned_rates": Take(lambda: change_axes(walk(), "shank_l", gyr=TURNS[5])),
    "magnets": Take(lambda: walk(dipoles=(Dipole((4.0, 0.3, 0.5), (0.3, 0.0, 0.2)),))),
    "saturated": Take(lambda: walk(gyr_range=radians(250.0), acc_range=2.0 * 9.80665)),
    "stuck_axis": Take(lambda: spoil("shank_r", stick_axis)),
    "stuck_rarely": Take(lambda: spoil("shank_r", stick_rarely)),
    "frozen": Take(lambda: spoil("shank_r", freeze)),
    "looped": Take(lambda: spoil("shank_r", loop)),
    "clipped": Take(lambda: spoil("foot_r", clip)),
    "clipped_force": Take(lambda: spoil("foot_r", clip_force)),
    "begun_late": Take(lambda: begin_late(walk(), "shank_l", 2.0)),
    "mid_walk": Take(lambda: shorten(walk(), 7.0, 20.0)),
    "swings": Take(lambda: simulate_swings_and_bows(SwingsAndBows(swings=6, bows=4)).recording),
    "single_feet": Take(lambda: walk(worn=("foot_l", "foot_r"))),
    "no_filter": Take(walk, {"poses.estimator": "stance_foot_anchor"}),
    "pauses": Take(lambda: walk(PAUSES)),
    "shanks": Take(lambda: walk(worn=LEGS)),
    "shanks_mixed": Take(
        lambda: walk(worn=LEGS), {"consensus.presets": ("gouwanda", "catalfamo", "maqbool")}
    ),
    "walk_by_consensus": Take(walk, {"detector": "consensus"}),
    **{
        name: Take(lambda name=name: simulate_scenario(name, 1, worn=(*FEET, "shank_l", "shank_r")).recording)  # type: ignore[misc]
        for name in ("festination", "severe_shuffle")
    },
    "by_gouwanda": detect_by("gouwanda", leaving="deepest", contact="neg_peak"),
    "by_maqbool": detect_by("maqbool"),
    "by_mariani": detect_by("mariani", contact="neg_peak"),
    "back_turning": Take(lambda: simulate_scenario("fast_with_turns", 1, worn=("pelvis",)).recording),
    "back_pauses": Take(lambda: walk(PAUSES, worn=("pelvis",))),
    "back_parkinson": Take(lambda: simulate_scenario("parkinson", 1, worn=("pelvis",)).recording),
    "back_festination": Take(lambda: simulate_scenario("festination", 1, worn=("pelvis",)).recording),
    "walk_10m": Take(lambda: replace(walk(worn=FEET), protocol="walk_10m")),
    "walk_6min": Take(
        lambda: replace(walk(worn=FEET), protocol="walk_6min", test_limits=GivenLimits(5.0, 20.0))
    ),
    "day": Take(lambda: live_a_day(*DAY)),
    "day_without_gyro": Take(lambda: live_a_day(*DAY, has_gyro=False, seed=2)),
    "day_of_chairs": Take(
        lambda: replace(
            simulate_day(CHAIR_DAY, seed=1, setup=replace(ON_SKIN, rate_hz=50.0)).recording,
            protocol="activity",
        )
    ),
    "careful_day": Take(
        lambda: replace(
            simulate_day(
                CHAIR_DAY,
                seed=3,
                setup=replace(ON_SKIN, rate_hz=50.0),
                style=ChestStyle(lean_rad=radians(15.0)),
            ).recording,
            protocol="activity",
        )
    ),
    "day_of_stairs": Take(
        lambda: live_a_day(
            DailyItem("stand", 10.0),
            DailyItem("walk", 40.0),
            DailyItem("stairs_up", 30.0),
            DailyItem("walk", 20.0),
            DailyItem("stairs_down", 30.0),
            DailyItem("stand", 10.0),
            DailyItem("sit", 30.0),
            DailyItem("stand", 10.0),
            DailyItem("bow", 4.0),
            DailyItem("stand", 10.0),
            DailyItem("bow", 4.0),
            DailyItem("stand", 10.0),
            DailyItem("sit", 30.0),
            DailyItem("stand", 10.0),
        )
    ),
    "day_of_sitting": Take(
        lambda: miss(
            live_a_day(
                DailyItem("stand", 10.0),
                DailyItem("sit", 60.0),
                DailyItem("stand", 20.0),
                DailyItem("sit", 60.0),
                DailyItem("stand", 20.0),
            ),
            40.0,
            45.0,
        )
    ),
    "day_of_errands": Take(
        lambda: live_a_day(
            DailyItem("stand", 10.0),
            DailyItem("walk", 40.0),
            DailyItem("stand", 10.0),
            DailyItem("walk", 3.2),
            DailyItem("stand", 10.0),
            DailyItem("walk", 4.2),
            DailyItem("stand", 10.0),
            DailyItem("walk", 5.2),
            DailyItem("stand", 10.0),
        )
    ),
    "standing": Take(lambda: declare(shorten(walk((Stand(9.0), *WALK[1:])), 0.0, 8.8))),
    "whole_test": Take(
        lambda: replace(walk(worn=FEET), protocol="walk_6min"), {"functional.walks.seconds": 20.0}
    ),
    "slipped_first": Take(lambda: edit(walk(), lambda u: slip_sensor(u, "shank_r", radians(15.0), 4.8))),
    "turn_first": Take(
        lambda: shorten(
            walk((Stand(5.0), Arc(1.0, pi, 0.5, 0.56), Straight(12.8, 0.64, 0.54), Stand(3.0)), worn=LEGS),
            0.0,
            16.0,
        )
    ),
    "rolling": Take(lambda: spoil("foot_l", roll)),
    "doubted": Take(lambda: walk(packet_loss=0.05), {"poses.erkf.reaccept_s": 0.01, "poses.erkf.gate": 0.1}),
    "night": Take(
        lambda: live_a_day(
            DailyItem("stand", 10.0),
            DailyItem("walk", 30.0),
            DailyItem("sit", 60.0),
            DailyItem(OFF, 2400.0),
            DailyItem("stand", 60.0),
            DailyItem("walk", 30.0),
            DailyItem("stand", 2000.0),
            DailyItem("sit", 60.0),
        )
    ),
}


@lru_cache(4)
def stage_take(name: str) -> StagedTake | DirectCall:
    """The take before each of its stages."""
    if name in CALLS:
        return DirectCall(CALLS[name])
    take = TAKES[name]
    config = PipelineConfig()
    for path, value in take.chosen.items():
        config = replace_value(config, tuple(path.split(".")), value)
    return StagedTake(take.make(), config)
