"""Cycle charts with their captions."""

from __future__ import annotations

from typing import Any, Final

from sagittal.server.report.charts.curves import cycle_svg
from sagittal.server.report.charts.panels import CurvePanel

COLUMNS: Final = 3
"""Charts per row: sagittal, frontal, transverse."""

PAGE_HEIGHTS: Final = {False: 144, True: 158}

PAPER_HEIGHTS: Final = {False: 124, True: 138}

GLANCE_HEIGHT: Final = 92
"""Of the three curves on the first printed page."""

KEY_HEIGHT: Final = 186
"""Chart heights in px; the last row also carries the unit of the x axis."""


def caption_chart(panel: CurvePanel, svg: str) -> dict[str, Any]:
    """A rendered chart with its captions."""
    return {
        "name": panel.variable.name,
        "title": panel.variable.label,
        "zero": panel.title.removeprefix(panel.variable.label).lstrip(", "),
        "low": panel.low_confidence,
        "reason": panel.reason,
        "svg": svg,
    }


def draw_chart(panel: CurvePanel, height: int, *, x_unit: bool, glance: bool = False) -> dict[str, Any]:
    """Render a chart `height` px high, with or without the unit of its x axis, and its captions.

    Parameters
    ----------
    glance : draw single strides at low resolution.
    """
    return caption_chart(panel, cycle_svg(panel, height=height, x_unit=x_unit, glance=glance))
