from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace
from itertools import accumulate

import pytest
from defusedxml.ElementTree import fromstring

from sagittal.server.report.charts.curves import cycle_svg, range_svg, strip_svg
from sagittal.server.report.charts.panels import DRAWN_STRIDES
from sagittal.server.report.files.bundle import Bundle
from sagittal.server.report.view.model import report_model

MakeBundle = Callable[..., Bundle]


@pytest.fixture(scope="module")
def knee(bundle: Bundle) -> ET.Element:
    assert bundle.angles is not None
    entered = replace(bundle.angles, standing_deg={"knee_flexion_l": 0.0, "knee_flexion_r": 0.0})
    visible_key_curve = report_model(replace(bundle, angles=entered)).key_curve
    root: ET.Element = fromstring(cycle_svg(visible_key_curve, x_unit=True))
    return root


def all_of(root: ET.Element, css: str) -> list[ET.Element]:
    return [e for e in root.iter() if css in (e.get("class") or "").split()]


def test_every_panel_is_well_formed_and_free_of_inline_style_and_colour(bundle: Bundle) -> None:
    for panel in report_model(bundle).panels:
        svg = cycle_svg(panel)
        if panel.reason is not None:
            assert svg == ""
            continue
        fromstring(svg)
        # the content policy refuses inline style, and colours belong to the tokens
        assert "style=" not in svg
        assert not re.search(r"#[0-9a-fA-F]{3,6}\b|rgb", svg)


def test_strokes_keep_their_width_because_only_the_inner_plot_stretches(knee: ET.Element) -> None:
    inner = knee.find("svg/svg")
    assert inner is not None
    assert inner.get("viewBox") == "0 0 1000 1000"
    assert inner.get("preserveAspectRatio") == "none"
    assert not any(e.tag == "text" for e in inner.iter())


def test_layers_lie_in_the_order_of_the_chart_rules(knee: ET.Element) -> None:
    order = [e.get("class") for e in knee.iter() if e.tag in {"polygon", "path", "line", "rect"}]
    firsts = [order.index(c) for c in ("band", "nm", "g", "sl", "sr", "ml", "mr", "fol", "cursor")]
    assert firsts == sorted(firsts)


def test_each_counted_stride_is_a_thin_line_with_its_number(bundle: Bundle, knee: ET.Element) -> None:
    drawn = {int(e.get("data-stride") or -1) for css in ("sl", "sr") for e in all_of(knee, css)}
    counted_strides = {i for i, s in enumerate(bundle.strides.strides) if s.excluded_reason is None}
    assert drawn == counted_strides


def test_long_takes_draw_a_spread_of_strides(make_bundle: MakeBundle) -> None:
    long = make_bundle(120.0)
    model = report_model(long)
    root = fromstring(cycle_svg(model.key_curve))
    left = [int(e.get("data-stride") or 0) for e in all_of(root, "sl")]
    assert len(left) == DRAWN_STRIDES
    counted_strides = [
        i for i, s in enumerate(long.strides.strides) if s.side == "left" and not s.excluded_reason
    ]
    assert (left[0], left[-1]) == (counted_strides[0], counted_strides[-1])
    assert any("Thin lines show 40" in note for note in model.curve_notes)


def test_axis_says_in_words_which_way_is_up(knee: ET.Element) -> None:
    texts = ["".join(e.itertext()) for e in knee.iter("text")]
    assert "Flexion ↑" in texts
    assert "Extension ↓" in texts
    assert "% of gait cycle" in texts
    assert "−20°" not in texts
    assert "L\u200962" in texts
    assert "R\u200962" in texts


def test_the_mean_passes_through_its_values(bundle: Bundle, knee: ET.Element) -> None:
    panel = report_model(bundle).key_curve
    mean = panel.sides["left"].mean_deg
    assert mean is not None
    x, y = follow_path(all_of(knee, "ml")[0].get("d") or "")
    low, high = panel.variable.y_range
    assert x == [10 * i for i in range(101)]
    for position, angle in zip(y, mean, strict=True):
        assert high - position / 1000 * (high - low) == pytest.approx(angle, abs=0.06)


def follow_path(d: str) -> tuple[list[int], list[int]]:
    """Points of a path that starts with M and continues with relative steps."""
    start, steps = d.removeprefix("M").split("l")
    moves = [re.fullmatch(r"(\d+)([+-]\d+)", step) for step in steps.split()]
    dx, dy = zip(*((int(m[1]), int(m[2])) for m in moves if m), strict=True)
    assert len(dx) == len(moves)
    x0, y0 = map(int, start.split())
    return list(accumulate(dx, initial=x0)), list(accumulate(dy, initial=y0))


def test_single_strides_are_coarser_at_a_glance(bundle: Bundle) -> None:
    panel = report_model(bundle).key_curve
    fine, coarse = (
        follow_path(all_of(fromstring(cycle_svg(panel, glance=glance)), "sl")[0].get("d") or "")
        for glance in (False, True)
    )
    assert len(coarse[0]) == 26
    assert coarse == (fine[0][::2], fine[1][::2])


def test_title_speaks_for_the_picture(knee: ET.Element) -> None:
    svg = knee.find("svg")
    assert svg is not None
    assert svg.get("role") == "img"
    assert "left mean of" in (svg.findtext("title") or "")


def test_single_strides_can_be_left_out(bundle: Bundle) -> None:
    root = fromstring(cycle_svg(report_model(bundle).key_curve, single_strides=False))
    assert not all_of(root, "sl")
    assert all_of(root, "ml")


def test_range_bar_clips_at_its_ends_and_draws_right_below_left() -> None:
    root = fromstring(range_svg({"left": 999.0, "right": -5.0}, (60.0, 2.0), (50.0, 80.0), width=100))
    right, left = (e for e in root.iter("circle"))
    assert (right.get("class"), left.get("class")) == ("dr", "dl")
    assert (right.get("cx"), left.get("cx")) == ("6", "94")
    assert len(all_of(root, "band")) == 1
    assert not all_of(fromstring(range_svg({"both": 1.0}, None, (0.0, 2.0))), "band")


def test_strip_shows_every_stride_and_crosses_the_ones_left_out(bundle: Bundle) -> None:
    root = fromstring(strip_svg(bundle.strides, 12.0))
    marks = list(root.iter("g"))
    assert len(marks) == len(bundle.strides.strides)
    out = [e for e in marks if "excluded: first of a walk" in (e.findtext("title") or "")]
    assert len(out) == 2
    assert all(all_of(e, "xx") for e in out)
    assert len(all_of(root, "now")) == 1
