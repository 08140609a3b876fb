"""Angles from the anatomical zero: rows beside those from standing, where a goniometer was used."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

from core.anatomical import anatomical_parameters
from core.norms import Norms
from core.parameters.result import CycleCurves
from server.report.table import Row, parameter_rows

GROUP = "Angles from the anatomical zero"


def level_rows(
    curves: CycleCurves,
    standing_deg: Mapping[str, float],
    norms: Norms,
    estimated: Collection[str] = (),
) -> tuple[Row, ...]:
    """Rows of the variables and sides whose standing angle was entered, named "…_anatomical_deg".

    Parameters
    ----------
    norms : of this person, looked up with `anatomical` = the variables of `anatomical_variables`.
    estimated : variables that no two sensors measure; a goniometer does not help them.
    """
    measured = replace(curves, curves={v: c for v, c in curves.curves.items() if v not in estimated})
    rows = parameter_rows(anatomical_parameters(measured, standing_deg), norms)
    return tuple(
        replace(row, name=f"{row.name.removesuffix('_deg')}_anatomical_deg", group=GROUP) for row in rows
    )
