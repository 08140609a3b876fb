"""A take with feedback, drawn stride by stride."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace

import pytest
from defusedxml.ElementTree import fromstring

from sagittal.core.feedback import AnalysedStride, Cue, FeedbackSplit, split
from sagittal.core.feedback.cue import WhyNot
from sagittal.server.report.charts.feedback_chart import feedback_svg
from sagittal.server.report.words.wording import parameter_term
from tests.helpers.feedback import NAME, prescription


def cue(n: int, why_not: WhyNot | None = None, level: int = 1, low: float = 0.5, high: float = 0.7) -> Cue:
    return Cue(n, "left", float(n), n + 1.0, 0.6, 0.0, "in", why_not is None, why_not, level, low, high)


def take(cues: list[Cue], values: list[float]) -> FeedbackSplit:
    strides = [AnalysedStride(c.side, c.start_s, v, True) for c, v in zip(cues, values, strict=True)]
    return split(strides, cues)


def draw(cues: list[Cue], values: list[float] | None = None) -> ET.Element:
    trial = take(cues, [0.6] * len(cues) if values is None else values)
    root: ET.Element = fromstring(feedback_svg(trial, prescription(), parameter_term(NAME)))
    return root


def of_class(root: ET.Element, css: str) -> list[ET.Element]:
    return [e for e in root.iter() if css in (e.get("class") or "").split()]


def test_strides_stand_in_their_order_filled_with_feedback_and_open_without() -> None:
    root = draw([cue(1), cue(2, "faded"), cue(3, "positive_only"), cue(4, "probe")])
    dots = [(e.get("x"), c.get("class")) for e in root.iter("svg") for c in e if c.tag == "circle"]
    # only good strides are shown: silence tells as well
    assert dots == [
        ("12.5%", "fb-on l"), ("37.5%", "fb-off l"), ("62.5%", "fb-on l"), ("87.5%", "fb-off l")
    ]  # fmt: skip


def test_blocks_without_feedback_are_columns_with_their_word() -> None:
    kinds: tuple[WhyNot | None, ...] = ("baseline", "baseline", None, "probe")
    root = draw([cue(n, reason) for n, reason in enumerate(kinds)])
    assert [(e.get("x"), e.get("width")) for e in of_class(root, "fb-block")] == [
        ("0", "500"), ("750", "250")
    ]  # fmt: skip
    words = [(e.get("x"), e.text) for e in of_class(root, "words")]
    assert words == [("25%", "before"), ("87.5%", "probe"), ("50%", "level 1")]


def test_a_narrow_block_gets_no_word() -> None:
    root = draw([cue(1, "probe"), *(cue(n) for n in range(2, 31))])
    assert len(of_class(root, "fb-block")) == 1
    assert [e.text for e in of_class(root, "words")] == ["level 1"]


def test_every_level_has_the_zone_of_its_strides_and_its_name() -> None:
    root = draw([cue(1), cue(2), cue(3, level=0, low=0.55, high=0.65), cue(4, level=0, low=0.55, high=0.65)])
    wide, narrow = of_class(root, "band")
    assert [(e.get("x"), e.get("width")) for e in (wide, narrow)] == [("0", "500"), ("500", "500")]
    assert float(wide.get("height") or 0) == pytest.approx(2 * float(narrow.get("height") or 0), abs=0.2)
    assert [e.text for e in of_class(root, "words")] == ["level 1", "level 0"]


def test_the_mean_of_the_target_is_a_line_where_it_lies_on_the_axis() -> None:
    assert len(of_class(draw([cue(1), cue(2)]), "nm")) == 1
    far = [replace(cue(n), zone_low=2.0, zone_high=2.1) for n in (1, 2)]
    assert of_class(draw(far, [2.05, 2.05]), "nm") == []


def test_a_value_far_off_lies_on_the_edge_and_does_not_press_the_zone_together() -> None:
    # six widths of 0.05 above the zone's end at 0.7 make 1.0 the highest value that is drawn
    position = [float(e.get("y") or 0) for e in draw([cue(1), cue(2)], [0.6, 9.0]).iter("svg") if e.get("x")]
    low, high = 0.5 - 0.06 * 0.5, 1.0 + 0.06 * 0.5
    assert position == pytest.approx([144.0 * (high - 0.6) / (high - low), 0.0], abs=0.1)
