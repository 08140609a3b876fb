"""Data quality badge: each fault once by name, none for what changes no number."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from sagittal.core.activity.parameters import measure_day
from sagittal.core.errors import Notice
from sagittal.core.formats.draft import FEW_ROWS, grade_loss
from sagittal.server.report.files.bundle import Bundle, join_faults
from sagittal.server.report.view.quality_box import NO_WHOLE_DAY, quality_box
from tests.server import daily
from tests.server.report.conftest import MakeBundle
from tests.server.report.words.test_estimator import section

ENDED = Notice(
    "unequal_lengths",
    "Sensor B7 on shank_l recorded from 0.0 to 18.0 s of 41.1 s; shank_l has no data for the rest.",
    "shank_l",
    18.0,
)
GAP = Notice(
    "gap", "shank_l has no data for 1 stretch(es) of 0.1 s and more, 56.2 % of the trial.", "shank_l", 18.0
)
FAILED = Notice(
    "sensor_failed", "The shank_l sensor can be used for 44% of the take, so it is left out.", "shank_l"
)
STUCK = Notice("channel_stuck", "The gyroscope of foot_l is stuck at one value from 9.0 s on.", "foot_l", 9.0)
FOOT_FAILED = Notice("sensor_failed", "The foot_l sensor can be used for 30% of the take.", "foot_l")
NO_FOOT = Notice("foot_missing", "No sensor on the left foot, or no sample of it.", "foot_l")
OTHER = Notice("rates_differ", "Sensors run at different rates.")
POOR = {"level": "poor", "reasons": ["shank_l has no data for 56 % of the trial."]}


def texts(notices: Sequence[Notice]) -> list[str]:
    return [n.message for n in notices]


def test_a_sensor_that_ended_early_is_one_notice() -> None:
    (messages, second) = join_faults((ENDED, GAP, OTHER, FAILED))[::-1]
    assert (messages.code, messages.sensor, messages.t_s) == ("sensor_failed", "shank_l", 18.0)
    assert messages.message == f"{ENDED.message} {FAILED.message}"
    assert second == OTHER


def test_a_foot_sensor_that_stuck_is_one_notice() -> None:
    (messages,) = join_faults((STUCK, NO_FOOT, FOOT_FAILED))
    assert messages.message == f"{STUCK.message} {FOOT_FAILED.message}"


def test_faults_of_different_sensors_stay_apart() -> None:
    assert texts(join_faults((ENDED, GAP, FOOT_FAILED))) == texts((ENDED, GAP, FOOT_FAILED))


def test_the_badge_names_the_fault_in_words(make_bundle: MakeBundle) -> None:
    box = quality_box(make_bundle(warnings=(OTHER, *join_faults((ENDED, GAP, FAILED))), quality=POOR))
    assert (box.kind, box.more) == ("bad", 1)
    assert box.reason.startswith("Sensor B7 on left shank recorded from 0.0 to 18.0 s of 41.1 s")
    assert "left shank sensor can be used for 44%" in box.reason


def test_what_stopped_the_analysis_goes_before_every_other_reason(make_bundle: MakeBundle) -> None:
    stopped = Notice("gravity_removed", "Sensor a has no gravity.", severity="error")
    box = quality_box(make_bundle(warnings=(FAILED, OTHER, stopped)))
    assert (box.word, box.reason, box.more) == ("Analysis stopped", "Sensor a has no gravity.", 2)


def test_without_a_notice_the_reason_of_the_level_is_told(make_bundle: MakeBundle) -> None:
    quality = {"level": "usable", "reasons": ["3.6 % of the samples of foot_l are interpolated."]}
    box = quality_box(make_bundle(quality=quality))
    assert (box.kind, box.reason) == ("warn", "3.6 % of the samples of left foot are interpolated.")


def test_sensors_that_contradict_each_other_are_the_reason(make_bundle: MakeBundle) -> None:
    quality = {"level": "poor", "signals_level": "good", "reasons": ["The sensors contradict each other."]}
    box = quality_box(make_bundle(warnings=(OTHER,), quality=quality, estimator=section(verdict="bad")))
    assert (box.word, box.reason, box.more) == ("Sensors disagree", "The sensors contradict each other.", 1)


@pytest.mark.parametrize("count", [1, 12])
def test_information_never_colours_the_badge(make_bundle: MakeBundle, count: int) -> None:
    notices = tuple(Notice(f"fact_{i}", "It changes no number.", severity="info") for i in range(count))
    box = quality_box(make_bundle(warnings=notices))
    assert (box.kind, box.reason, box.more) == ("ok", "", 0)


def test_a_row_that_a_file_lost_is_information() -> None:
    assert grade_loss(1, 2503) == "info"
    assert grade_loss(int(FEW_ROWS * 1000), 1000) == "info"
    assert grade_loss(11, 1000) == "warning"


def test_daily_life_without_a_complete_day_is_not_good_data() -> None:
    live_result = daily.live(3)
    short = replace(live_result, days=tuple(replace(day, worn_h=4.0) for day in live_result.days))
    whole, blank = (
        quality_box(
            Bundle({"level": "good"}, None, parameters, (), {}, activity=activity),
        )
        for parameters, activity in ((measure_day(live_result), live_result), (measure_day(short), short))
    )
    assert (whole.kind, whole.word, whole.reason) == ("ok", "Good data", "")
    assert (blank.kind, blank.word, blank.reason) == ("warn", "No complete day", NO_WHOLE_DAY)
