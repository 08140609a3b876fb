"""Leaflet for patients: two or three parameters in plain language, with previous values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from sagittal.core.change import NOT_MEASURED_ALIKE, Change
from sagittal.core.frames import Side
from sagittal.core.parameters.catalogue import require_entries
from sagittal.core.parameters.result import Parameter
from sagittal.server.report.words.wording import format_number


@dataclass(frozen=True)
class PlainFigure:
    """Description of a parameter for lay readers.

    Parameters
    ----------
    title : with {side} for a leg. unit, factor, digits : conversion to everyday units.
    up, down : wording of a real change.
    """

    name: str
    title: str
    unit: str
    factor: float
    digits: int
    up: str
    down: str


FIGURES: Final = (
    PlainFigure("gait_speed_mps", "How fast you walk", "metres in ten seconds", 10.0, 1, "faster", "slower"),
    PlainFigure(
        "step_length_m", "How long your {side} step is", "centimetres", 100.0, 0, "longer", "shorter"
    ),
    PlainFigure(
        "knee_flexion_rom_deg",
        "How far your {side} knee moves",
        "degrees",
        1.0,
        0,
        "further",
        "less far",
    ),
)
"""Speed, step and knee: the parameters most relevant to patients."""

require_entries((f.name for f in FIGURES), "sagittal.server.report.history.leaflet")

REAL: Final = ("real_change", "clinically_relevant")


@dataclass(frozen=True)
class LeafletFigure:
    """A parameter as shown on the leaflet.

    Parameters
    ----------
    now, before : value with its unit; before None = not compared. words : description of the change.
    estimated : estimated by a leg model rather than measured by two sensors.
    """

    title: str
    now: str
    before: str | None
    words: str
    estimated: bool


def list_figures(
    parameters: Sequence[Parameter], changes: Sequence[Change], affected: Side | None
) -> tuple[LeafletFigure, ...]:
    """Measured parameters; of a leg the affected side, otherwise the smaller value.

    Parameters
    ----------
    changes : since the previous visit, empty if not comparable.
    """
    figures = []
    for figure in FIGURES:
        mine = {p.side: (p.mean, p) for p in parameters if p.name == figure.name and p.mean is not None}
        if not mine:
            continue
        side = affected if affected in mine else min(mine, key=lambda s: mine[s][0])
        value, change_text = mine[side]
        change = next((c for c in changes if (c.name, c.side) == (figure.name, side)), None)
        previous = None if change is None or change.difference is None else change.before
        figures.append(
            LeafletFigure(
                figure.title.format(side=side),
                _say(figure, value),
                None if previous is None else _say(figure, previous),
                _judge(figure, change),
                change_text.estimated,
            )
        )
    return tuple(figures)


def _say(figure: PlainFigure, value: float) -> str:
    return f"{format_number(figure.factor * value, figure.digits)} {figure.unit}"


def _judge(figure: PlainFigure, change: Change | None) -> str:
    """Name a change only if it exceeds the measurement error."""
    if change is not None and change.reason == NOT_MEASURED_ALIKE:
        return "It was measured differently last time, so the two values are not compared."
    if change is None or change.difference is None:
        return "There is no earlier value to compare with."
    if change.verdict in REAL:
        return f"This is {figure.up if change.difference > 0 else figure.down} than last time."
    if change.verdict is None:
        return "It is not yet possible to say whether this is a change."
    return "This is about the same as last time."
