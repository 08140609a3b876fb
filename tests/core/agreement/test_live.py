"""Live comparison: notices, withdrawals, independence of block sizes."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.agreement import check_agreement
from sagittal.core.agreement.exchange import LEGS, Swap, undo_exchange
from sagittal.core.agreement.live_terms import LiveTerms, RawSecond
from sagittal.core.agreement.params import JointParams
from sagittal.core.agreement.terms import find_terms
from sagittal.core.errors import Notice
from sagittal.core.signals.recording import SensorSignals, UniformRecording
from tests.helpers.live_agreement import find_standings, listen
from tests.helpers.perturbations import delay_sensor, slip_sensor
from tests.helpers.walks import only, simulated

STOOD = (300,)

NAMES = ("acc", "gyr", "valid")


def walk() -> UniformRecording:
    simulation = simulated("comfortable", 1)[0]
    return only(simulation, *(s for s in simulation.sensors if s != "chest"))


def followed(one: UniformRecording, second: UniformRecording, at_s: float) -> UniformRecording:
    """One take up to a moment, the other one from there on."""
    k = round(at_s * one.rate_hz)

    def joined(a: SensorSignals, b: SensorSignals) -> SensorSignals:
        acc, gyr = (np.concatenate((x[:k], y[k:])) for x, y in ((a.acc, b.acc), (a.gyr, b.gyr)))
        return replace(a, acc=acc, gyr=gyr, mag=None)

    return replace(one, sensors={s: joined(x, second.sensors[s]) for s, x in one.sensors.items()})


def first_sentence(notice: Notice) -> str:
    """Its words without the numbers, which rest on fewer windows."""
    return re.sub(r"\d+", "#", notice.message.replace(";", ".").split(". ")[0])


@pytest.mark.sweep
def test_listening_begins_where_live_calibration_finds_the_standing() -> None:
    assert find_standings(walk()) == STOOD


@pytest.mark.sweep
def test_a_right_take_is_told_nothing_of() -> None:
    watch, notices = listen(walk(), STOOD)
    assert notices == []
    assert watch.doubts == {}


@pytest.mark.sweep
def test_a_late_sensor_is_told_once_in_the_words_of_a_file() -> None:
    late = delay_sensor(walk(), "shank_r", 0.040)
    watch, notices = listen(late, STOOD)
    ((_, notice),) = notices
    (expected,) = check_agreement(late).recording.notices
    assert (notice.code, notice.sensor, notice.severity) == ("sensor_late", "shank_r", "warning")
    assert first_sentence(notice) == first_sentence(expected)
    assert watch.doubts == {"shank_r": "sensor_late"}


@pytest.mark.sweep
@pytest.mark.parametrize("swap", [(("shank_l", "shank_r"),), LEGS])
def test_exchanged_sensors_are_told_once_in_the_words_of_a_file(swap: Swap) -> None:
    wrong = replace(walk(), sensors=undo_exchange(swap, walk().sensors))
    watch, notices = listen(wrong, STOOD)
    ((_, notice),) = notices
    (expected,) = check_agreement(wrong).recording.notices
    assert notice.code == "sensors_exchanged"
    assert first_sentence(notice) == first_sentence(expected)
    assert watch.doubts == {s: "sensors_exchanged" for pair in swap for s in pair}


def test_one_leg_on_the_other_side_is_told_of() -> None:
    wrong = replace(walk(), sensors=undo_exchange(LEGS, walk().sensors))
    segments = only(wrong, "pelvis", "thigh_l", "thigh_r", "shank_r", "foot_r")
    _, notices = listen(delay_sensor(segments, "shank_r", 0.06), STOOD)
    # by the labels that fit
    assert [(n.code, n.sensor) for _, n in notices] == [
        ("sensors_exchanged", "thigh_l"),
        ("sensor_late", "shank_l"),
    ]


def test_a_slip_is_told_with_its_moment() -> None:
    at_s = 17.0
    watch, notices = listen(slip_sensor(walk(), "thigh_l", np.radians(15.0), at_s), STOOD)
    ((when, notice),) = notices
    assert (notice.code, notice.sensor) == ("sensor_slipped", "thigh_l")
    assert notice.t_s == pytest.approx(at_s, abs=2.5)
    assert when < at_s + 12.0
    assert watch.doubts == {"thigh_l": "sensor_slipped"}


def test_a_clock_that_is_right_again_is_said_to_be() -> None:
    mended = followed(delay_sensor(walk(), "foot_l", 0.060), walk(), 22.0)
    watch, notices = listen(mended, STOOD)
    assert [n.code for _, n in notices] == ["sensor_late", "sensors_agree_again"]
    assert [n.severity for _, n in notices] == ["warning", "info"]
    assert watch.doubts == {}


def test_calibrating_again_forgets_what_was_told() -> None:
    watch, _ = listen(delay_sensor(walk(), "shank_r", 0.040), STOOD)
    watch.forget()
    assert watch.doubts == {}


@pytest.mark.sweep
def test_blocks_do_not_matter() -> None:
    take = slip_sensor(delay_sensor(walk(), "foot_r", 0.040), "shank_l", np.radians(15.0), 17.0)
    expected = [n for _, n in listen(take, STOOD)[1]]
    assert {n.code for n in expected} == {"sensor_late", "sensor_slipped"}
    for sizes in ((7,), (1, 130, 33), (len(take.t_s),)):
        assert [n for _, n in listen(take, STOOD, sizes)[1]] == expected


def test_a_sensor_that_never_sends_keeps_nobody_waiting() -> None:
    take = delay_sensor(walk(), "shank_r", 0.040)
    foot = take.sensors["foot_l"]
    silent = replace(
        foot, acc=np.zeros_like(foot.acc), gyr=np.zeros_like(foot.gyr), valid=np.zeros_like(foot.valid)
    )
    _, notices = listen(replace(take, sensors={**take.sensors, "foot_l": silent}), STOOD)
    assert [(n.code, n.sensor) for _, n in notices] == [("sensor_late", "shank_r")]


def test_sensors_without_a_joint_are_not_compared() -> None:
    feet = only(walk(), "foot_l", "foot_r")
    watch, notices = listen(feet, STOOD)
    assert notices == []
    assert watch.doubts == {}


def test_terms_of_a_second_are_those_of_a_file() -> None:
    take, params = only(walk(), "shank_l", "foot_l"), JointParams()
    whole = [find_terms(x, take.rate_hz, params).M for x in take.sensors.values()]
    segments = list(take.sensors.values())
    seconds = [
        RawSecond(*(np.stack([getattr(x, name)[k : k + 100] for x in segments], axis=1) for name in NAMES))
        for k in range(0, 3000, 100)
    ]
    live = LiveTerms(seconds[0], take.rate_hz, params)
    for second in seconds[1:]:
        frame = live.push(second)
        if frame is None or frame.start < 900:
            continue
        start = (100 + frame.start) // 2
        for M, expected in zip(frame.M, whole, strict=True):
            part = expected[start - 8 : start + 58]
            assert M.shape == part.shape
            # the heading of the level frames is free, and where they began differs
            ours, theirs = M[:, 2], part[:, 2]
            assert np.sqrt(np.mean((ours - theirs) ** 2)) < 0.02 * np.sqrt(np.mean(theirs**2))
