"""The takes of a visit on one line."""

from __future__ import annotations

import pytest
from defusedxml.ElementTree import fromstring

from sagittal.core.parameters.result import Parameter
from sagittal.server.report.history.takes_chart import ROOM, WIDTH, find_scale, takes_svg


def figure(mean: float | None, sd: float | None = None) -> Parameter:
    return Parameter("gait_speed_mps", None, 10, mean, sd, "m/s")


def test_a_scale_holds_every_take_with_its_spread_and_some_room() -> None:
    scale = find_scale([figure(1.0, 0.2), figure(1.5), figure(None), figure(1.4, 0.4)])
    assert scale == pytest.approx((0.8 - 0.05, 1.8 + 0.05))


def test_one_value_without_a_spread_has_a_scale_too() -> None:
    assert find_scale([figure(2.0)]) == pytest.approx((1.8, 2.2))
    assert find_scale([figure(0.0)]) == (-1.0, 1.0)


def test_without_a_value_there_is_no_scale() -> None:
    assert find_scale([figure(None)]) is None
    assert find_scale([]) is None


def test_takes_are_rings_with_their_spread_and_the_mean_is_a_bar() -> None:
    takes = [figure(0.0), figure(None), figure(2.0, 0.5)]
    svg = fromstring(takes_svg(takes, figure(1.0), (0.0, 2.0), 'speed "a" < b'))
    assert svg.get("aria-label") == 'speed "a" < b'
    result = [(e.get("class"), e.get("cx") or (e.get("x1"), e.get("x2"))) for e in svg]
    inside = WIDTH - 2 * ROOM
    ends = (f"{ROOM + 0.75 * inside:g}", f"{ROOM + 1.25 * inside:g}")
    middle = f"{ROOM + 0.5 * inside:g}"
    assert result == [
        ("zero", (f"{ROOM}", f"{WIDTH - ROOM}")),
        ("tk", f"{ROOM}"),
        ("tk-sd", ends),
        ("tk", f"{WIDTH - ROOM}"),
        ("tk-mean", (middle, middle)),
    ]


def test_a_mean_that_is_not_known_has_no_bar() -> None:
    svg = fromstring(takes_svg([figure(1.0)], figure(None), (0.0, 2.0), "one take"))
    assert [e.get("class") for e in svg] == ["zero", "tk"]
