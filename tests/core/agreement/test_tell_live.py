"""The same words while samples come: nothing is repaired, and what holds no more is taken back."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sagittal.core.agreement.exchange import SensorExchange
from sagittal.core.agreement.params import LagParams
from sagittal.core.agreement.tell import say_exchange, say_lag, say_slip
from sagittal.core.agreement.tell_live import (
    AGAIN,
    take_back,
    tell_exchange_now,
    tell_lag_now,
    tell_slip_now,
)
from sagittal.core.errors import Notice
from tests.core.agreement.test_tell import LATE, SLIP


@pytest.mark.parametrize(
    ("lag_s", "sure", "code", "severity", "advice"),
    [
        (0.040, True, "sensor_late", "warning", True),
        (-0.026, True, "sensor_late", "warning", True),
        (-0.025, True, "sensor_late", "info", False),
        (0.040, False, "clocks_disagree", "warning", True),
    ],
)
def test_a_lag_is_told_with_its_moment(
    lag_s: float, sure: bool, code: str, severity: str, advice: bool
) -> None:
    lag = replace(LATE, lag_s=lag_s, sure=sure)
    text = tell_lag_now(lag, LagParams(warn_s=0.025), 31.5)
    assert (text.code, text.sensor, text.t_s, text.severity) == (code, "shank_r", 31.5, severity)
    assert text.message.startswith(f"{say_lag(lag)}. ")
    assert ("Synchronise the sensors" in text.message) == advice
    assert "shifted" not in text.message


def test_an_exchange_and_a_slip_ask_for_another_calibration() -> None:
    sensor_exchange = SensorExchange((("shank_l", "shank_r"),), 1.4, 0.9)
    text = tell_exchange_now(sensor_exchange, 12.0)
    assert (text.code, text.sensor, text.t_s) == ("sensors_exchanged", "shank_l", 12.0)
    assert text.message.startswith(say_exchange(sensor_exchange))
    slipped = tell_slip_now(SLIP)
    assert (slipped.code, slipped.sensor, slipped.t_s) == ("sensor_slipped", "thigh_l", SLIP.at_s)
    assert slipped.message.startswith(say_slip(SLIP))
    for message in (text.message, slipped.message):
        assert message.endswith("calibrate again.")


@pytest.mark.parametrize(
    ("code", "says"),
    [
        ("sensors_exchanged", "The sensors of foot_l and foot_r fit where they are worn now."),
        ("sensor_slipped", "The sensor on foot_l and foot_r is back in its position from before the slip."),
        ("sensor_late", "The clock of foot_l and foot_r agrees with the others now."),
        ("clocks_disagree", "The clock of foot_l and foot_r agrees with the others now."),
    ],
)
def test_what_was_told_is_taken_back_in_its_own_words(code: str, says: str) -> None:
    notices = take_back(Notice(code, "…", "foot_l", 3.0), ("foot_l", "foot_r"), 9.0)
    assert notices == Notice(AGAIN, says, "foot_l", 9.0, "info")
