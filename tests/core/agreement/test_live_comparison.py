"""Sensor comparison from a standing on: settled labels, and notices by fitting labels."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

from sagittal.core.agreement.live_comparison import SensorComparison, Verdict
from sagittal.core.agreement.live_terms import RawSecond
from sagittal.core.agreement.params import LiveAgreementParams
from sagittal.core.signals.recording import UniformRecording
from tests.helpers.perturbations import delay_sensor
from tests.helpers.walks import only, simulated

FIRST_S = 3.0
"""Everybody stands until then, and walks from 5.3 s on."""


@cache
def ankle() -> UniformRecording:
    return only(simulated("comfortable", 1)[0], "shank_l", "foot_l")


def seconds(take: UniformRecording, from_s: float) -> Iterator[RawSecond]:
    rate = round(take.rate_hz)
    segments = list(take.sensors.values())
    for k in range(round(from_s * rate), len(take.t_s) - rate + 1, rate):
        acc, gyr, valid = (
            np.stack([x[k : k + rate] for x in inputs], axis=1)
            for inputs in zip(*((s.acc, s.gyr, s.valid) for s in segments), strict=True)
        )
        yield RawSecond(acc, gyr, valid)


def compare(take: UniformRecording) -> list[Verdict]:
    """Notices from the standing on."""
    standing, *later = seconds(take, FIRST_S - 1.0)
    rate = take.rate_hz
    sensor_comparison = SensorComparison(
        tuple(take.sensors), standing, round(FIRST_S * rate), rate, round(rate / 50.0), LiveAgreementParams()
    )
    frames = (sensor_comparison.push(x) for x in later)
    return [x for x in frames if x is not None]


def test_right_sensors_are_settled_after_some_windows_of_walking_and_nothing_is_told() -> None:
    first, *later = compare(ankle())
    assert first.exchange.swap == ()
    # 6 s of a window, of which five move; three windows, confirmed three times
    assert first.t_s == pytest.approx(5.3 + 6.0 + 4.0, abs=2.0)
    assert (first.lags, first.slips, first.back) == ((), (), frozenset())
    assert len(later) > 5
    assert np.diff([x.t_s for x in (first, *later)]).min() == pytest.approx(1.0)
    assert all(x.exchange is first.exchange and not x.lags and not x.slips for x in later)


def test_a_late_foot_is_said_by_its_ankle_alone() -> None:
    last = compare(delay_sensor(ankle(), "foot_l", 0.060))[-1]
    (lag,) = last.lags
    assert not lag.sure
    assert abs(lag.lag_s) == pytest.approx(0.060, abs=0.01)
    assert last.exchange.swap == ()


def test_people_who_stand_are_told_nothing() -> None:
    take = ankle()
    standing = next(seconds(take, FIRST_S - 1.0))
    sensor_comparison = SensorComparison(
        tuple(take.sensors), standing, 0, take.rate_hz, round(take.rate_hz / 50.0), LiveAgreementParams()
    )
    assert [sensor_comparison.push(standing) for _ in range(12)] == [None] * 12
