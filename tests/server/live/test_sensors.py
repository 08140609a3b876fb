"""Sensors as the recorder alone knows them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from sagittal.core.formats.live_log import Hello
from sagittal.server.live.messages import BATTERY_WARN_PCT
from sagittal.server.live.sensors import sensor_rows
from tests.helpers.live_takes import HELLO


def said(
    hello: Hello = HELLO, *heard: int, silent: bool = False, battery: Mapping[str, float] | None = None
) -> list[tuple[Any, ...]]:
    return [
        (r["id"], r["state"], r["words"]) for r in sensor_rows(hello, heard, battery or {}, silent=silent)
    ]


def test_before_a_sample_came_there_is_no_data_and_then_all_is_well() -> None:
    assert said() == [(i, "none", "no data yet") for i in ("A1", "A2", "B1")]
    assert said(HELLO, 0) == [("A1", "ok", ""), ("A2", "ok", ""), ("B1", "none", "no data yet")]


def test_silence_is_worse_than_a_low_battery_and_both_than_nothing() -> None:
    low = {"A1": BATTERY_WARN_PCT - 0.1, "A2": BATTERY_WARN_PCT}
    assert said(HELLO, 0, 3, battery=low) == [
        ("A1", "warn", "battery low"),
        ("A2", "ok", ""),
        ("B1", "ok", ""),
    ]
    assert {state for _, state, _ in said(HELLO, 0, 3, silent=True, battery=low)} == {"bad"}
    assert said(HELLO, silent=True)[0] == ("A1", "none", "no data yet")


def test_a_sensor_without_a_place_is_not_used() -> None:
    first = HELLO.streams[0]
    spare = replace(first, sensors=(replace(first.sensors[0], segment=None),))
    assert said(replace(HELLO, streams=(spare,)), 0, silent=True, battery={"A1": 1.0}) == [
        ("A1", "none", "not used")
    ]


@pytest.mark.parametrize("stream", [0, 1])
def test_what_only_an_estimator_counts_is_none(stream: int) -> None:
    rows = sensor_rows(HELLO, (), {"B1": 40.0}, silent=False)
    row = rows[2 * stream]
    assert (row["lost_pct"], row["still"]) == (None, None)
    assert (row["segment"], row["rate_hz"], row["battery_pct"]) == (
        ("pelvis", 100.0, None),
        ("foot_r", 50.0, 40.0),
    )[stream]
