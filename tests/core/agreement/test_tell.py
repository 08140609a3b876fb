"""Texts of inconsistent sensors: numbers, signs, actions."""

from __future__ import annotations

from dataclasses import replace
from math import radians

import pytest

from sagittal.core.agreement.exchange import SensorExchange
from sagittal.core.agreement.lags import SensorDrift, SensorLag
from sagittal.core.agreement.params import ExchangeParams, LagParams, SlipParams
from sagittal.core.agreement.slips import SensorSlip
from sagittal.core.agreement.tell import (
    list_sensors,
    say_exchange,
    say_lag,
    say_slip,
    tell_drift,
    tell_exchange,
    tell_lag,
    tell_left_over,
    tell_slip,
)

LATE = SensorLag(("shank_r", "foot_r"), 0.0404, 0.0012, told=True, sure=True)
SLIP = SensorSlip("thigh_l", 17.2, 2.4, -radians(15.0), radians(1.2), (0.0, 0.0, 1.0))


def test_a_lag_is_said_in_milliseconds_with_its_direction() -> None:
    assert say_lag(LATE) == "The clock of shank_r and foot_r is 40 ± 1 ms late"
    early = replace(LATE, sensors=("foot_l",), lag_s=-0.0404, sure=False)
    assert say_lag(early) == "The clock of foot_l seems 40 ± 1 ms early"


def test_what_was_done_about_a_lag_is_said() -> None:
    text = tell_lag(LATE, LagParams())
    assert (text.code, text.sensor, text.severity) == ("sensor_late", "shank_r", "warning")
    assert "its samples were shifted accordingly. Synchronise" in text.message
    little = tell_lag(replace(LATE, lag_s=-0.025), LagParams(warn_s=0.025))
    assert little.severity == "info"
    assert "Synchronise" not in little.message
    assert tell_lag(replace(LATE, lag_s=-0.0251), LagParams(warn_s=0.025)).severity == "warning"
    left = tell_lag(LATE, LagParams(repair=False))
    assert "It was not corrected" in left.message
    unsure = tell_lag(replace(LATE, sure=False), LagParams())
    assert unsure.code == "clocks_disagree"
    assert "nothing was shifted" in unsure.message


@pytest.mark.parametrize(("change_s", "which"), [(0.030, "slow"), (-0.030, "fast")])
def test_a_drift_has_a_direction(change_s: float, which: str) -> None:
    drift = SensorDrift("foot_l", change_s, 0.004, 10.0, 70.0)
    text = tell_drift(drift, LagParams())
    assert (text.code, text.sensor) == ("clock_drifts", "foot_l")
    assert text.message.startswith(
        f"The clock of foot_l runs {which}, by 30 ± 4 ms over the walk; its samples"
    )
    assert "it was not corrected" in tell_drift(drift, LagParams(repair=False)).message


def test_an_exchange_names_its_pairs() -> None:
    sensor_exchange = SensorExchange((("thigh_l", "thigh_r"), ("foot_l", "foot_r")), 1.5, None)
    assert say_exchange(sensor_exchange) == (
        "Joint motion shows that sensors are swapped: thigh_l with thigh_r and foot_l with foot_r."
    )
    text = tell_exchange(sensor_exchange, ExchangeParams())
    assert (text.code, text.sensor) == ("sensors_exchanged", "thigh_l")
    assert "with the corrected assignment" in text.message
    assert "Nothing was changed" in tell_exchange(sensor_exchange, ExchangeParams(repair=False)).message


def test_a_slip_is_said_in_degrees_with_its_moment() -> None:
    assert say_slip(SLIP) == "The sensor on thigh_l slipped by 15 ± 1° about 17 s."
    at_rest = say_slip(replace(SLIP, at_rest=True))
    assert at_rest.startswith("The sensor on thigh_l slipped by 15 ± 1° before the walk at 20 s, or its leg")


def test_what_follows_from_a_slip_is_said() -> None:
    shank = tell_slip(replace(SLIP, segment="shank_l"), SlipParams())
    assert (shank.code, shank.sensor, shank.t_s) == ("sensor_slipped", "shank_l", 17.2)
    assert "within 2 s of the slip are excluded; later samples were corrected" in shank.message
    assert "From 15 s on it is excluded" in tell_slip(SLIP, SlipParams()).message
    assert "From 0 s on" in tell_slip(replace(SLIP, at_s=1.0), SlipParams()).message
    assert "It is excluded as if" in tell_slip(replace(SLIP, at_rest=True), SlipParams()).message
    assert "It was not corrected" in tell_slip(SLIP, SlipParams(repair=False)).message


def test_what_is_left_after_the_repair_is_doubtful() -> None:
    text = tell_left_over(replace(LATE, lag_s=-0.0404))
    assert (text.code, text.sensor) == ("clocks_disagree", "shank_r")
    assert "After correction shank_r and foot_r still appears 40 ms out of sync" in text.message


def test_sensors_are_listed_as_in_a_sentence() -> None:
    assert list_sensors(["a"]) == "a"
    assert list_sensors(["a", "b"]) == "a and b"
    assert list_sensors(("a", "b", "c")) == "a, b and c"
