"""Angles from the anatomical zero: rows beside those from standing, where a goniometer was used."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Final

from core.events.result import Strides
from core.frames import SIDES
from core.norms import Norms
from core.parameters.anatomical_zero import anatomical_parameters, standing_name
from core.parameters.result import CycleCurves
from core.parameters.rows import Column
from core.standing_angles import JOINTS, PELVIS
from server.report.table import ParameterRow, parameter_rows

GROUP = "Angles from the anatomical zero"


_SUFFIX: Final = "_anatomical_deg"


def from_standing(name: str) -> str | None:
    """Name of the same figure from standing; None for any other row."""
    return f"{name.removesuffix(_SUFFIX)}_deg" if name.endswith(_SUFFIX) else None


def level_column(
    name: str, strides: Strides, columns: Mapping[str, Column], standing_deg: Mapping[str, float]
) -> Column | None:
    """The figure of every stride from the anatomical zero: that from standing plus what was read."""
    column = columns.get(from_standing(name) or "")
    if column is None:
        return None
    variable = next((v for v in (*PELVIS, *JOINTS) if name.startswith(f"{v}_")), "")
    read = {s: standing_deg.get(standing_name(variable, s)) for s in SIDES}
    return tuple(
        None if v is None or (zero := read[s.side]) is None else v + zero
        for s, v in zip(strides.strides, column, strict=True)
    )


def level_rows(
    curves: CycleCurves,
    standing_deg: Mapping[str, float],
    norms: Norms,
    estimated: Collection[str] = (),
) -> tuple[ParameterRow, ...]:
    """Rows of the variables and sides whose standing angle was entered, named "…_anatomical_deg".

    Parameters
    ----------
    norms : of this person, looked up with `anatomical` = the variables of `anatomical_variables`.
    estimated : variables that no two sensors measure; a goniometer does not help them.
    """
    measured = replace(curves, curves={v: c for v, c in curves.curves.items() if v not in estimated})
    rows = parameter_rows(anatomical_parameters(measured, standing_deg), norms, zero="anatomical")
    return tuple(replace(row, name=f"{row.name.removesuffix('_deg')}{_SUFFIX}", group=GROUP) for row in rows)
