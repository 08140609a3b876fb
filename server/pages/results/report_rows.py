"""Arrangement of the parameter table: first rows, collapsed groups, printed rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from sagittal.core.message import Message
from sagittal.core.parameters.catalogue import require_entries
from sagittal.core.parameters.catalogue.entry import FUNCTIONAL, SQUAT
from sagittal.core.plurals import plural
from sagittal.server.report.view import level
from sagittal.server.report.view.model import ReportModel
from sagittal.server.report.view.table import BEYOND_SD, ParameterRow

SECONDARY: Final = (
    "Parts of stance and swing",
    "Walking and turning",
    "Regularity of the trunk",
    "Support in seconds",
)
"""Groups for detailed inspection: collapsed on the page, omitted in print."""

MATTERING: Final = (
    "gait_speed_mps",
    "cadence_spm",
    "step_length_m",
    "stance_pct",
    "double_support_pct",
    "knee_flexion_max_swing_deg",
    "hip_flexion_min_deg",
    "ankle_dorsiflexion_ic_deg",
    "foot_pitch_ic_deg",
    "pci_pct",
    "foot_pitch_tc_deg",
    "max_heel_clearance_m",
    "circumduction_m",
    "stride_time_s",
    "step_time_s",
    "step_regularity_v",
    "stride_regularity_v",
    "harmonic_ratio_v",
    "step_count",
    "walking_duration_min",
)
"""The most important parameters for a therapist, depending on the sensors."""

FIRST_ROWS: Final = 10

NOT_ON_PAPER: Final = ("swing_pct", "swing_time_s", "turning_angle_deg")
"""Parameters redundant with others or absent in straight walking."""

require_entries((*MATTERING, *NOT_ON_PAPER), "sagittal.server.pages.results.report_rows")


def select_first(model: ReportModel) -> tuple[ParameterRow, ...]:
    """The ten most important available rows in fixed order; all rows for squats and tests.

    Joint angles use the zero of their curve.
    """
    rows = {row.name: row for _, group in model.page_groups for row in group}
    if model.squats is not None:
        return tuple(row for row in rows.values() if row.group == SQUAT)
    if model.functional is not None and not model.strides:
        return tuple(row for row in rows.values() if row.group in FUNCTIONAL and row.reason is None)
    from_zero = {level.from_standing(name): row for name, row in rows.items()}
    selected = (from_zero.get(name) or rows.get(name) for name in MATTERING)
    return tuple(row for row in selected if row is not None and row.reason is None)[:FIRST_ROWS]


def fold_groups(model: ReportModel, first: Sequence[ParameterRow]) -> list[dict[str, Any]]:
    """Remaining rows by group, with the number outside the norm in each heading."""
    names = {row.name for row in first}
    groups = ((name, [row for row in rows if row.name not in names]) for name, rows in model.page_groups)
    return [{"name": name, "rows": rows, "words": _count_beyond(rows)} for name, rows in groups if rows]


def _count_beyond(rows: Sequence[ParameterRow]) -> str:
    beyond = sum(
        any(c is not None and c.z is not None and abs(c.z) > BEYOND_SD for c in (r.both, r.left, r.right))
        for r in rows
    )
    values = Message(f"{{rows}} {plural(len(rows), 'value', 'values')}", rows=len(rows))
    return (
        Message(
            "{values}, {beyond} beyond {BEYOND_SD:g} SD", values=values, beyond=beyond, BEYOND_SD=BEYOND_SD
        )
        if beyond
        else values
    )


def select_groups(model: ReportModel, *, paper: bool) -> list[tuple[str, tuple[ParameterRow, ...]]]:
    """The parameter table; empty if no value is available, since a sentence then replaces it.

    In print, only measured parameters have a row; `missing` lists the others in one line.
    """
    groups = [(name, rows) for name, rows in model.page_groups if name not in SECONDARY]
    if all(row.reason for _, rows in groups for row in rows):
        return []
    if not paper:
        return groups
    short = (
        (name, tuple(r for r in rows if r.reason is None and r.name not in NOT_ON_PAPER))
        for name, rows in groups
    )
    return [(name, rows) for name, rows in short if rows]


def select_others(
    model: ReportModel, first: Sequence[ParameterRow]
) -> list[tuple[str, tuple[ParameterRow, ...]]]:
    """Printed rows that are not among the first ones."""
    names = {row.name for row in first}
    short = (
        (name, tuple(r for r in rows if r.name not in names))
        for name, rows in select_groups(model, paper=True)
    )
    return [(name, rows) for name, rows in short if rows]
