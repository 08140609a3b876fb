"""Labels of printed charts do not overlap the curves."""

from __future__ import annotations

from xml.etree.ElementTree import Element, fromstring

import pytest

from sagittal.server.report.charts.paper_words import SVG, place_words


def chart(path: str, word: str = "Flexion ↑", y: int = 0, dy: int = 11, more: str = "") -> Element:
    return fromstring(  # noqa: S314 - ours
        f'<svg xmlns="{SVG[1:-1]}"><svg><path class="ml" d="{path}"/></svg>{more}'
        f'<text class="words halo" x="0" y="{y}" dx="5" dy="{dy}" text-anchor="start">{word}</text></svg>'
    )


def place(figure: Element) -> tuple[float, float]:
    place_words(figure, 150.0, 54.0, 34.0)
    (word,) = (t for t in figure.iter(f"{SVG}text") if "words" in t.get("class", ""))
    return tuple(float(word.get(n, "0")) + float(word.get(f"d{n}", "0")) for n in "xy")  # type: ignore[return-value]


@pytest.mark.parametrize(
    ("figure", "found"),
    [
        # nothing there
        (chart("M 0 30 l 150 0"), (5.0, 11.0)),
        # below the curve of the first half; then to its right
        (chart("M 0 8 l 70 0 10 30 70 0"), (75.0, 11.0)),
        # a curve along the lower edge leaves room right under it
        (chart("M 0 44 l 150 0", "Extension ↓", 54, -5), (5.0, 55.0)),
        # along the upper edge: above the plot, but not on the foot-off that is named there
        (chart("M 0 8 l 150 0"), (-34.0, -5.0)),
    ],
)
def test_a_word_goes_where_no_curve_is(figure: Element, found: tuple[float, float]) -> None:
    assert place(figure) == found


def test_what_is_named_above_stays_clear_too() -> None:
    named = '<text class="tl" x="10" y="-5" dx="0" dy="0" text-anchor="end">L 61</text>'
    x, y = place(chart("M 0 8 l 150 0", more=named))
    assert y > 0
    assert x >= 0
