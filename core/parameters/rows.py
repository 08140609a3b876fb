"""Figures of single strides: a number, or the reason why there is none, by name; and what sums them up."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from math import isfinite, isnan

from core.events.result import Strides
from core.frames import SIDES, Floats, Side
from core.parameters.catalogue import unit_of
from core.parameters.result import Parameter
from core.parameters.variability import summarise_values

Value = float | str
"""A figure of one stride, or the code of the reason why it has none."""

Row = Mapping[str, Value]
"""Figures of one stride by name."""

Column = tuple[float | None, ...]
"""One figure of every stride of the list, counted or not."""


def as_column(values: Floats) -> Column:
    """A figure (strides,) as a column: None where it is NaN."""
    return tuple(None if isnan(v) else v for v in values.tolist())


def row_columns(rows: Sequence[Row], names: Iterable[str]) -> dict[str, Column]:
    """Columns of the stride table, one entry per stride."""
    return {n: tuple(v if isinstance(v := row[n], float) else None for row in rows) for n in names}


def row_parameter(name: str, side: Side | None, rows: Sequence[Row]) -> Parameter:
    """Parameter over these strides; without a value the most frequent reason, "no_strides" without any."""
    values = [v for row in rows if isinstance(v := row[name], float)]
    if values:
        return summarise_values(name, side, values, unit_of(name))
    reasons = Counter(v for row in rows if isinstance(v := row[name], str))
    return summarise_values(
        name, side, [], unit_of(name), reasons.most_common(1)[0][0] if reasons else "no_strides"
    )


def side_parameters(strides: Strides, rows: Sequence[Row], names: Iterable[str]) -> tuple[Parameter, ...]:
    """Parameters of both sides over the counted strides; `rows` are those of all strides of the list."""
    pairs = list(zip(strides.strides, rows, strict=True))
    counted = {s: [row for x, row in pairs if x.side == s and x.excluded_reason is None] for s in SIDES}
    names = tuple(names)
    return tuple(row_parameter(name, side, counted[side]) for side in SIDES for name in names)


def value_or(number: float, reason: str) -> Value:
    """The number, or the reason where it is not finite."""
    return number if isfinite(number) else reason
