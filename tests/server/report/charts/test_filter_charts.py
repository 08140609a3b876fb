"""Charts of a comparison of filters."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from defusedxml.ElementTree import fromstring

from sagittal.server.report.charts.filter_charts import AGREEMENT_HEIGHT, TOP, draw_agreement, draw_spread


def read(chart: str) -> ET.Element:
    root: ET.Element = fromstring(chart)
    return root


def texts(root: ET.Element, css: str = "") -> list[tuple[str, str]]:
    """Place and words of the labels of a class."""
    return [(str(e.get("x")), str(e.text)) for e in root.iter("text") if (e.get("class") or "") == css]


def test_a_spread_is_a_line_of_each_side_over_the_whole_cycle() -> None:
    lines = {"left": np.array([0.0, 1.0, 2.0]), "right": np.array([2.0, 2.0, 0.0])}
    root = read(draw_spread("Knee", lines, 2.0, 0.0, "cycle"))  # type: ignore[arg-type]
    assert {e.get("class"): e.get("d") for e in root.iter("path")} == {
        "ml": "M0 1000L500 500L1000 0",
        "mr": "M0 0L500 0L1000 1000",
    }
    assert ("40%", "40") in texts(root)
    assert "".join(root.itertext()).startswith(
        "Knee: standard deviation between the filters over the gait cycle"
    )


def test_a_line_is_interrupted_where_it_has_no_value() -> None:
    values = np.array([0.0, 1.0, np.nan, 1.0, 0.0])
    root = read(draw_spread("Knee", {None: values}, 1.0, 4.0, "time"))
    ((css, d),) = [(e.get("class"), e.get("d")) for e in root.iter("path")]
    assert (css, d) == ("mb", "M0 1000L250 0M750 0L1000 1000")
    assert [t for _, t in texts(root) if t.endswith("s")] == [f"{s}\u2009s" for s in range(5)]
    assert "over time" in "".join(root.itertext())


def test_only_the_grid_line_at_zero_is_the_zero_line() -> None:
    root = read(draw_spread("Knee", {None: np.zeros(2)}, 1.0, 1.0, "cycle"))
    assert next((e.get("class"), e.get("y1")) for e in root.iter("line")) == ("z", "1000")
    assert sum(e.get("class") == "z" for e in root.iter("line")) == 1
    assert next(t for _, t in texts(root) if t.endswith("°")) == "0.0°"


def agreement() -> ET.Element:
    return read(draw_agreement("Knee", [10.0, 20.0, 30.0], [-1.0, 0.5, 1.0], [0.2, -1.5, 1.9]))


def test_differences_lie_over_the_mean_of_both() -> None:
    root = agreement()
    dots = [
        (float((e.get("x") or "").removesuffix("%")), float(e.get("y") or 0))
        for e in root.iter("svg")
        if any(c.get("class") == "ba" for c in e)
    ]
    edge = 100 * 0.03 / 1.06
    assert [x for x, _ in dots] == pytest.approx([edge, 50.0, 100 - edge], abs=0.1)
    low, high = -1.5 - 0.08 * 3.4, 1.9 + 0.08 * 3.4
    height = AGREEMENT_HEIGHT - TOP - 34
    expected = [height * (high - d) / (high - low) for d in (-1.0, 0.5, 1.0)]
    assert [y for _, y in dots] == pytest.approx(expected, abs=0.1)


def test_bias_and_limits_are_lines_with_their_numbers() -> None:
    root = agreement()
    assert texts(root, "words halo") == [
        ("100%", "bias 0.2°"), ("100%", "−1.96 SD −1.5°"), ("100%", "+1.96 SD 1.9°"), ("0", "Filter more ↑")
    ]  # fmt: skip
    levels = [(e.get("class"), float(e.get("y1") or 0)) for e in root.iter("line")]
    by_css = {css: y for css, y in levels if css == "bal"}
    assert by_css["bal"] == pytest.approx(1000 * (1.9 + 0.08 * 3.4 - 0.2) / (1.16 * 3.4), abs=0.1)
    assert sum(css == "mdcl" for css, _ in levels) == 2


def test_one_point_without_a_difference_can_be_drawn() -> None:
    chart = draw_agreement("Knee", [5.0], [0.0], [0.0, 0.0, 0.0])
    assert not re.search("nan|inf", chart)
    (dot,) = (e for e in read(chart).iter("svg") if any(c.get("class") == "ba" for c in e))
    assert dot.get("x") == "50%"
