"""Angles relative to the anatomical zero, if measured by goniometer, in addition to standing."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from typing import Final

from sagittal.core.events.result import Strides
from sagittal.core.frames import SIDES
from sagittal.core.norms import Norms
from sagittal.core.parameters.anatomical_zero import anatomical_parameters, standing_name, standing_offset_deg
from sagittal.core.parameters.catalogue import find_entry
from sagittal.core.parameters.result import CycleCurves, Parameter
from sagittal.core.parameters.rows import Column
from sagittal.core.subject.standing_angles import JOINTS, PELVIS
from sagittal.server.report.view.table import ParameterRow, parameter_rows
from sagittal.server.report.words.wording import title_of

GROUP = "Angles from neutral (0°)"

STANDING: Final = "relative to standing"
"""Parts of definitions that do not apply to anatomical angles."""

ANATOMICAL: Final = "from neutral (0°)"
"""Their replacements."""

_SUFFIX: Final = "_anatomical_deg"


def from_standing(name: str) -> str | None:
    """Name of the same parameter relative to standing; None for other rows."""
    return f"{name.removesuffix(_SUFFIX)}_deg" if name.endswith(_SUFFIX) else None


def define_parameter(name: str) -> str:
    """Definition of a parameter, "" if not in the catalogue; also for the anatomical zero."""
    entry = find_entry(from_standing(name) or name)
    if entry is None or from_standing(name) is None:
        return "" if entry is None else entry.definition
    return entry.definition.replace(STANDING, ANATOMICAL)


def label_parameter(name: str) -> str:
    """Label of a parameter, or its name if not in the catalogue; angles include their zero."""
    standing = from_standing(name)
    entry = find_entry(standing or name)
    if entry is None:
        return name
    return entry.label if standing is None else title_of(standing, entry.label, "anatomical")


def level_column(
    name: str, strides: Strides, columns: Mapping[str, Column], standing_deg: Mapping[str, float]
) -> Column | None:
    """Values of all strides relative to the anatomical zero, by adding the goniometer reading."""
    column = columns.get(from_standing(name) or "")
    if column is None:
        return None
    variable = next((v for v in (*PELVIS, *JOINTS) if name.startswith(f"{v}_")), "")
    read = {
        s: standing_offset_deg(variable, s, standing_deg)
        for s in SIDES
        if standing_name(variable, s) in standing_deg
    }
    return tuple(
        None if v is None or (zero := read.get(s.side)) is None else v + zero
        for s, v in zip(strides.strides, column, strict=True)
    )


def level_parameters(
    curves: CycleCurves, standing_deg: Mapping[str, float], estimated: Collection[str] = ()
) -> tuple[Parameter, ...]:
    """Parameters of variables and sides with a goniometer reading, named "…_anatomical_deg".

    Parameters
    ----------
    estimated : variables estimated by a model, for which a goniometer reading is not used.
    """
    measured = _measured_parameters(curves, standing_deg, estimated)
    return tuple(replace(p, name=_level_name(p.name)) for p in measured)


def level_rows(
    curves: CycleCurves,
    standing_deg: Mapping[str, float],
    norms: Norms,
    estimated: Collection[str] = (),
) -> tuple[ParameterRow, ...]:
    """Rows of `level_parameters`.

    Parameters
    ----------
    norms : for the patient, looked up with `anatomical` = the variables of `anatomical_variables`.
    """
    measured = _measured_parameters(curves, standing_deg, estimated)
    rows = parameter_rows(measured, norms, zero="anatomical")
    return tuple(replace(row, name=_level_name(row.name), group=GROUP) for row in rows)


def choose_zero(rows: Iterable[ParameterRow], anatomical: Collection[str]) -> tuple[ParameterRow, ...]:
    """Rows of a page: every joint angle once, with the zero of its curve.

    Parameters
    ----------
    anatomical : variables with curves relative to the anatomical zero.
    """
    all_rows = tuple(rows)
    names = {row.name for row in all_rows}

    def is_of_page(row: ParameterRow) -> bool:
        entry = find_entry(from_standing(row.name) or row.name)
        is_anatomical = entry is not None and entry.curve is not None and entry.curve.variable in anatomical
        if from_standing(row.name) is not None:
            return is_anatomical
        return not (is_anatomical and _level_name(row.name) in names)

    return tuple(row for row in all_rows if is_of_page(row))


def _measured_parameters(
    curves: CycleCurves, standing_deg: Mapping[str, float], estimated: Collection[str]
) -> tuple[Parameter, ...]:
    measured = replace(curves, curves={v: c for v, c in curves.curves.items() if v not in estimated})
    return anatomical_parameters(measured, standing_deg)


def _level_name(name: str) -> str:
    return f"{name.removesuffix('_deg')}{_SUFFIX}"
