"""Tables of an export, each with a header and rows, shared by workbook and CSV.

Names, units and definitions are taken from the catalogue of parameters.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import degrees, isfinite
from typing import Final

from sagittal.core.frames import SUFFIX
from sagittal.core.message import Message
from sagittal.core.parameters.catalogue import CATALOGUE, name_counted, unit_of
from sagittal.core.parameters.kinematic import POINTS, cycle_curves, mean_curve
from sagittal.core.parameters.result import MeanCurve
from sagittal.core.parameters.uncertainty import is_estimated
from sagittal.server.export.content import ExportContent
from sagittal.server.report.view.level import GROUP, define_parameter, from_standing, label_parameter

Row = tuple[object, ...]


@dataclass(frozen=True)
class TableSheet:
    """A table; None in a row is undefined."""

    name: str
    header: tuple[str, ...]
    rows: tuple[Row, ...]


TABLE_COLUMNS: Final = {
    "subject": "Pseudonym of the person",
    "visit": "Name of the visit",
    "cycle": "Number of the stride or squat in the list of the take, from 1; counted and left out alike",
    "side": "left or right; empty for the whole take",
    "start_s": "Begin in seconds from the start of the recording: initial contact",
    "tc_s": "Foot-off in the same seconds",
    "end_s": "End in the same seconds: next initial contact of the same foot",
    "parameter": "Name of the value, explained in this dictionary",
    "value": "The number in the unit beside it; empty where it is not defined",
    "unit": "Unit of the value; empty for a ratio",
    "counted": "1 where the stride counts in means, 0 where it was left out",
    "excluded_reason": "Why it was left out: a rule, or manual: with a person's words",
    "flags": "Rules that the stride meets, also where it counts",
    "n": "Strides behind a mean",
    "mean": "Mean over those that count",
    "sd": "Standard deviation over those that count",
    "cv_pct": "Coefficient of variation in %; empty below 10 strides and for angles",
    "ci_low": "Lower end of the 95 % confidence interval of the mean",
    "ci_high": "Upper end of it",
    "uncertainty": "The mean ± this holds the true value with 95 %",
    "estimated": "1 where a model of the leg gives the angle, and no two sensors measure it",
    "estimated_angles": "Angles whose values a model of the leg gives, and no two sensors measure",
    "reason": "Why there is no number",
    "note": "What to know of the number, as a code",
    "pct_cycle": "Percent of the stride, from initial contact",
    "kind": "ic = initial contact, tc = terminal contact (foot-off)",
    "source": "Which detector found the contact; manual = a person",
}
"""Columns that are not parameters → definition."""


def list_about(content: ExportContent) -> TableSheet:
    """Table of patient, visit, conditions and software."""
    v, origin = content.visit, content.bundle.provenance
    quality, angles = content.bundle.quality, content.bundle.angles
    rows: list[Row] = [
        ("subject", v.subject),
        ("code", v.code),
        ("visit", v.visit),
        ("day", v.day),
        ("protocol", v.protocol),
        ("sex", v.sex),
        ("age_years", v.age_years),
        ("height_m", v.height_m),
        ("affected_side", v.affected_side),
        ("condition", v.condition),
        ("quality", quality.get("level")),
        ("verdict", content.verdict),
        ("estimated_angles", " ".join(content.estimated) or None),
        ("angle_zero", None if angles is None else angles.zero),
        ("edits", len(content.edits)),
        ("exported_by", Message("Sagittal {version}", version=v.version).strip()),
        ("analysed_by", origin.get("version")),
        ("parameters_sha256", origin.get("parameters_sha256")),
        *((f"input_sha256 {name}", digest) for name, digest in (origin.get("input_sha256") or {}).items()),
        ("notice", "Research and documentation software, not a medical device, not for diagnosis."),
    ]
    return TableSheet("About", ("what", "value"), tuple(rows))


def list_parameters(content: ExportContent) -> TableSheet:
    """One row per parameter and side, over the included strides."""
    header = ("parameter", "side", "n", "mean", "sd", "unit", "cv_pct", "ci_low", "ci_high")
    rows = tuple(
        (
            *(p.name, p.side, p.n, p.mean, p.sd, p.unit, p.cv_pct, p.ci_low, p.ci_high),
            *(p.uncertainty, int(p.estimated), p.reason, p.note),
        )
        for p in content.parameters
    )
    return TableSheet("Parameters", (*header, "uncertainty", "estimated", "reason", "note"), rows)


CYCLE: Final = (
    *("cycle", "side", "start_s", "tc_s", "end_s", "counted", "excluded_reason", "flags"),
    "estimated_angles",
)


def list_cycles(content: ExportContent) -> TableSheet:
    """One row per stride or squat, with one column per parameter."""
    names = tuple(dict.fromkeys(name for c in content.cycles for name in c.values))
    rows = tuple(
        (
            *(c.number, c.side, c.start_s, c.tc_s, c.end_s, int(c.excluded is None), c.excluded),
            " ".join(c.flags),
            " ".join(a for a in content.estimated if a.endswith(f"_{SUFFIX[c.side]}")) or None,
            *(c.values.get(name) for name in names),
        )
        for c in content.cycles
    )
    return TableSheet("Strides" if content.bundle.repetitions is None else "Squats", (*CYCLE, *names), rows)


def list_values(content: ExportContent) -> TableSheet:
    """One row per stride (or squat) and parameter."""
    header = ("subject", "visit", "cycle", "side", "start_s", "end_s", "parameter", "value", "unit")

    def rows() -> Iterator[Row]:
        subject, visit, modelled = content.visit.subject, content.visit.visit, content.estimated
        units = {name: unit_of(name) for c in content.cycles for name in c.values}
        for c in content.cycles:
            first = (subject, visit, c.number, c.side, c.start_s, c.end_s)
            last = (int(c.excluded is None), c.excluded, " ".join(c.flags))
            for name, value in c.values.items():
                yield (*first, name, value, units[name], int(is_estimated(name, c.side, modelled)), *last)

    return TableSheet("Values", (*header, "estimated", "counted", "excluded_reason", "flags"), tuple(rows()))


def list_curves(content: ExportContent) -> TableSheet:
    """Mean and standard deviation of each angle in degrees over the included strides, one row per %."""
    angles = content.bundle.angles
    if angles is None:
        return TableSheet("Curves", ("pct_cycle",), ())
    header, columns = ["pct_cycle"], []
    cycles = cycle_curves(angles, content.bundle.strides)
    for variable, sides in cycles.curves.items():
        for side in sides:
            curve = mean_curve(cycles, variable, side)
            if curve.mean is not None:
                header += [f"{variable}_{side}_mean_deg", f"{variable}_{side}_sd_deg"]
                columns += _in_degrees(curve)
    rows = tuple((i, *(column[i] for column in columns)) for i in range(POINTS)) if columns else ()
    return TableSheet("Curves", tuple(header), rows)


def _in_degrees(curve: MeanCurve) -> list[list[float | None]]:
    """Mean and standard deviation, 101 numbers each; None if undefined."""
    nothing: list[float | None] = [None] * POINTS
    return [
        nothing if values is None else [degrees(x) if isfinite(x) else None for x in values.tolist()]
        for values in (curve.mean, curve.sd)
    ]


def list_events(content: ExportContent) -> TableSheet:
    """Contacts in order of time, including those edited manually."""
    rows = tuple((e.time_s, e.side, e.kind, e.source) for e in content.bundle.events.events)
    return TableSheet("Contacts", ("time_s", "side", "kind", "source"), rows)


def list_notices(content: ExportContent) -> TableSheet:
    """All notices of the analysis."""
    rows = tuple((n.severity, n.code, n.message, n.sensor, n.t_s) for n in content.bundle.warnings)
    return TableSheet("Notices", ("severity", "code", "message", "sensor", "time_s"), rows)


def list_dictionary(content: ExportContent) -> TableSheet:
    """Definitions of all columns and parameters of these tables."""
    used = {p.name for p in content.parameters} | {n for c in content.cycles for n in c.values}
    header = ("name", "label", "unit", "group", "of", "mean_of", "definition")
    columns = [(name, None, unit_of(name), "columns", None, None, s) for name, s in TABLE_COLUMNS.items()]
    entries = [
        (name, e.label, unit_of(name), e.group, e.of, name_counted(name), e.definition)
        for name, e in CATALOGUE.items()
        if name in used
    ]
    for name in dict.fromkeys(p.name for p in content.levels):
        e = CATALOGUE[from_standing(name) or name]
        words = label_parameter(name), define_parameter(name)
        entries.append((name, words[0], unit_of(name), GROUP, e.of, name_counted(name), words[1]))
    return TableSheet("Dictionary", header, (*columns, *entries))
