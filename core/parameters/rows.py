"""Values of single strides: numbers, or the reasons why there are none, by name; and their summaries."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sagittal.core.events.result import Strides, list_known
from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.parameters.catalogue import unit_of
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.variability import summarise_values

Value = float | str
"""A figure of one stride, or the code of the reason why it has none."""

Row = Mapping[str, Value]
"""Figures of one stride by name."""

Column = tuple[float | None, ...]
"""One figure of every stride of the list, counted or not."""

Codes = NDArray[np.object_]
"""Reasons (strides,), "" where there is none."""


@dataclass(frozen=True, eq=False)
class Figure:
    """Values of one parameter for every stride of a list.

    Parameters
    ----------
    values : (strides,) NaN if missing. reasons : for missing values, else "".
    """

    values: Floats
    reasons: Codes


Figures = Mapping[str, Figure]
"""By name, all of the same strides."""

NO_REASON = np.array("", np.object_)


def tell_figure(values: Floats, reasons: Codes | str) -> Figure:
    """Finite values (strides,), with reasons for the others, one each or one for all."""
    finite = np.isfinite(values)
    return Figure(np.where(finite, values, np.nan), np.where(finite, NO_REASON, reasons))


def as_column(values: Floats) -> Column:
    """Values (strides,) as a column: None for NaN."""
    return tuple(list_known(values))


def figure_columns(figures: Figures) -> dict[str, Column]:
    """Columns of the stride table, one entry per stride."""
    return {name: as_column(figure.values) for name, figure in figures.items()}


def read_row(figures: Figures, place: int) -> dict[str, Value]:
    """Values of one stride, by its index in the list."""
    return {name: x.reasons[place] or float(x.values[place]) for name, x in figures.items()}


def figure_parameter(
    name: str, side: Side | None, figure: Figure, chosen: NDArray[np.bool_ | np.intp]
) -> Parameter:
    """Parameter over selected strides; without a value the most frequent reason, "no_strides" without any."""
    values = figure.values[chosen]
    values = values[~np.isnan(values)]
    if len(values):
        return summarise_values(name, side, values, unit_of(name))
    reasons = Counter(figure.reasons[chosen].tolist())
    return summarise_values(
        name, side, values, unit_of(name), reasons.most_common(1)[0][0] if reasons else "no_strides"
    )


def side_parameters(strides: Strides, figures: Figures) -> tuple[Parameter, ...]:
    """Parameters of both sides over the counted strides; `figures` contain all strides of the list."""
    used = strides.columns.used
    return tuple(figure_parameter(name, side, x, used[side]) for side in SIDES for name, x in figures.items())
