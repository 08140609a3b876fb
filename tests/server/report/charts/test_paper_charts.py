"""Figures for a renderer that knows no style of the page inside of an `<svg>`."""

from __future__ import annotations

from xml.etree.ElementTree import fromstring

import pytest

from sagittal.server.report.charts.paper_charts import prepare_figures, read_chart_styles, stretch_path
from sagittal.server.report.charts.paper_words import SVG

STYLES = """
:root { --left: light-dark(#D55E00, #F5873A); --ink: light-dark(#11181E, #E9EDF0); }
:root { --wide: 2px; --font: Arial; }
/* .chart .gone { stroke: red } */
.chart .ml, .note { stroke: var(--left); stroke-width: var(--wide); vector-effect: non-scaling-stroke; }
.chart.cycle { padding: 18px 8px 20px 34px; } .chart.cycle.x-unit { padding-bottom: 30px; }
.ml { fill: none; }
"""

PAGE = f"""<main><div class="r-kin"><div class="chart cycle x-unit">
<svg xmlns="{SVG[1:-1]}" width="100%" height="100">
<svg viewBox="0 0 1000 1000" preserveAspectRatio="none" width="100%" height="100%">
<path class="ml" d="M0 500l20-10 20+5"/><line class="cursor" hidden="hidden"/>
<polygon points="0 0 1000 500"/></svg>
<text x="50%" y="100">50</text></svg></div></div></main>"""


def test_a_chart_gets_its_place_in_px_and_its_colours_written_out() -> None:
    page = fromstring(PAGE)  # noqa: S314 - ours
    prepare_figures(page, read_chart_styles(STYLES))
    figure = next(page.iter(f"{SVG}svg"))
    assert figure.get("viewBox") == "-34 -18 230 148"
    style = next(figure.iter(f"{SVG}style")).text
    assert style == ".ml { stroke: #D55E00; stroke-width: 2px }"
    # the plot is 230 − 34 − 12 px wide: the last label needs half its width
    assert next(figure.iter(f"{SVG}path")).get("d") == "M 0.00 50.00 l 3.68 -1.00 3.68 0.50"
    assert next(figure.iter(f"{SVG}polygon")).get("points") == "0.00 0.00 184.00 50.00"
    assert next(figure.iter(f"{SVG}text")).get("x") == "92.00"
    assert not list(figure.iter(f"{SVG}line"))


@pytest.mark.parametrize(
    ("path", "stretched"),
    [
        ("M0 500l20-10H40v5z", "M 0.00 1000.00 l 10.00 -20.00 H 20.00 v 10.00 z"),
        ("M1.5-2L3 4", "M 0.75 -4.00 L 1.50 8.00"),
        ("", ""),
    ],
)
def test_every_number_of_a_path_is_stretched_along_its_own_axis(path: str, stretched: str) -> None:
    assert stretch_path(path, 0.5, 2.0) == stretched
