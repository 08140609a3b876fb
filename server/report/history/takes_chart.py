"""Chart of the trials of a visit on one line: rings with the spread of their strides, a bar at the mean."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from sagittal.core.parameters.result import Parameter
from sagittal.server.report.charts.svg import format_coordinate

WIDTH, HEIGHT, ROOM = 92, 24, 6
"""Size in px, and margin at both ends."""


def find_scale(values: Sequence[Parameter]) -> tuple[float, float] | None:
    """Limits of a scale that includes all trials of a patient with their spread; None without values."""
    lows = [p.mean - (p.sd or 0.0) for p in values if p.mean is not None]
    highs = [p.mean + (p.sd or 0.0) for p in values if p.mean is not None]
    if not lows:
        return None
    low, high = min(lows), max(highs)
    room = 0.05 * (high - low) or 0.1 * abs(high) or 1.0
    return low - room, high + room


def takes_svg(takes: Sequence[Parameter], mean: Parameter, scale: tuple[float, float], label: str) -> str:
    """Draw the trials with a value; `label` is the text alternative."""
    low, high = scale

    def x(value: float) -> str:
        return format_coordinate(ROOM + (WIDTH - 2 * ROOM) * (value - low) / (high - low))

    shapes = [f'<line class="zero" x1="{ROOM}" x2="{WIDTH - ROOM}" y1="12" y2="12"/>']
    for p in takes:
        if p.mean is None:
            continue
        if p.sd is not None:
            shapes.append(
                f'<line class="tk-sd" x1="{x(p.mean - p.sd)}" x2="{x(p.mean + p.sd)}" y1="12" y2="12"/>'
            )
        shapes.append(f'<circle class="tk" cx="{x(p.mean)}" cy="12" r="3.4"/>')
    if mean.mean is not None:
        shapes.append(f'<line class="tk-mean" x1="{x(mean.mean)}" x2="{x(mean.mean)}" y1="4" y2="20"/>')
    return (
        f'<svg class="chart takes" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
        f'role="img" aria-label="{escape(label)}">{"".join(shapes)}</svg>'
    )
