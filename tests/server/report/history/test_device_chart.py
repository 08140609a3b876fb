"""What takes showed of a sensor, drawn over their days."""

from __future__ import annotations

import datetime as dt
import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence

import pytest
from defusedxml.ElementTree import fromstring

from sagittal.server.report.history.device_chart import draw_device
from sagittal.server.report.history.trend_chart import ROOM

DAYS = (dt.date(2026, 3, 1), dt.date(2026, 3, 6), dt.date(2026, 3, 11))


def draw(values: Sequence[float | None], days: Sequence[dt.date] = DAYS, least: float = 1.0) -> ET.Element:
    chart = draw_device("Noise", days, values, digits=1, least=least, band=None)
    assert chart is not None
    root: ET.Element = fromstring(chart)
    return root


def dots(root: ET.Element) -> list[tuple[str, str]]:
    """Place and class of each dot."""
    return [(str(e.get("x")), str(c.get("class"))) for e in root.iter("svg") for c in e if c.tag == "circle"]


def texts(root: ET.Element, css: str) -> list[str]:
    return [str(e.text) for e in root.iter("text") if e.get("class") == css]


def test_takes_stand_at_their_days_and_the_newest_is_large_and_named() -> None:
    root = draw([1.0, 2.0, 3.04])
    assert dots(root) == [("6%", "ps-b"), ("50%", "ps-b"), ("94%", "pl-b")]
    assert texts(root, "strong halo") == ["3.0"]
    assert sorted(texts(root, "words")) == ["1 Mar", "11 Mar", "6 Mar"]
    assert "".join(root.itertext()).startswith("Noise by trial")


def test_a_take_that_did_not_measure_it_is_left_out() -> None:
    assert dots(draw([1.0, None, 3.0])) == [("6%", "ps-b"), ("94%", "pl-b")]
    assert draw_device("Noise", DAYS, [None] * 3, digits=1, least=1.0) is None


def test_takes_of_one_day_lie_beside_each_other() -> None:
    places = [float(x.removesuffix("%")) for x, _ in dots(draw([1.0, 2.0], [DAYS[0]] * 2))]
    share = 1 - 2 * ROOM
    assert places == pytest.approx([100 * (ROOM + share / 4), 100 * (ROOM + 3 * share / 4)])


def test_days_that_would_touch_between_first_and_last_have_no_label() -> None:
    near = (DAYS[0], DAYS[0] + dt.timedelta(days=1), DAYS[2])
    assert sorted(texts(draw([1.0, 2.0, 3.0], near), "words")) == ["1 Mar", "11 Mar"]


def heights(root: ET.Element) -> list[float]:
    (path,) = (e.get("d") or "" for e in root.iter("path"))
    return [float(y) for y in re.findall(r" (-?[\d.]+)", path)]


def test_noise_does_not_fill_the_axis() -> None:
    # 0.1 of an axis of 10, in its middle
    assert heights(draw([1.0, 1.1, 1.0], least=10.0)) == pytest.approx([505.0, 495.0, 505.0], abs=0.1)
    # 10 with 8 % of room at either end
    top, bottom = 1000 * 0.8 / 11.6, 1000 * 10.8 / 11.6
    assert heights(draw([0.0, 10.0, 0.0])) == pytest.approx([bottom, top, bottom], abs=0.1)


def test_the_band_of_no_change_is_on_the_axis_even_where_no_value_is() -> None:
    chart = draw_device("Noise", DAYS, [1.0, 1.0, 1.0], digits=1, least=1.0, band=(0.0, 2.0))
    assert chart is not None
    (band,) = (e for e in fromstring(chart).iter("rect") if e.get("class") == "mdc")
    assert float(band.get("height")) == pytest.approx(1000 * 2.0 / 2.32, abs=0.1)
