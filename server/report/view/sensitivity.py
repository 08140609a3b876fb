"""Sensitivity analysis of squats as files, text and page, in the layout of Kianifar's tables 2 and 3.

{stem}.json   everything, angles in degrees (schema 1)      {stem}.csv   one row per parameter and angle
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from sagittal.core.message import Message
from sagittal.core.squat.joints import JOINTS
from sagittal.server.report.files.columns import SCHEMA, reduce_to_plain, write_csv
from sagittal.server.report.words.wording import format_number

if TYPE_CHECKING:
    # imports numba, which the web process avoids
    from sagittal.core.frames import Floats, Side
    from sagittal.core.squat.sensitivity import SensitivityRow, SensitivityTable

COLUMNS: Final = (
    "Ankle IR/ER", "Ankle Abd/Add", "Ankle Flex/Ext", "Knee Flex/Ext", "Hip Flex/Ext", "Hip Abd/Add",
    "Hip IR/ER",
)  # fmt: skip
HEADER: Final = (
    "side", "parameter", "angle", "nominal", "unit", "error_deg", "sensitivity_pct", "delta_relative_deg",
    "step", "delta_step_deg", "reason",
)  # fmt: skip

TABLES: Final[tuple[tuple[str, tuple[int, ...], tuple[int, ...], str], ...]] = (
    ("Ankle and knee", (0, 1, 2, 3), (0, 1, 2), "Ankle average"),
    ("Hip", (4, 5, 6), (4, 5, 6), "Hip average"),
)
"""Title, columns, averaged columns, and label of their average."""

SHOWN: Final[Mapping[str, str]] = {
    "step": "delta_step_deg",
    "share": "delta_relative_deg",
    "quotient": "sensitivity_pct",
}
"""Displayed quantity → key of a row."""

GROUPS: Final[tuple[tuple[str, Mapping[str, str]], ...]] = (
    (
        "Sensor alignment",
        {
            "Roll-tib": "Shin, rotation about the bone",
            "Pitch-tib": "Shin, to the side",
            "Yaw-tib": "Shin, forward or back",
            "Roll-thi": "Thigh, rotation about the bone",
            "Pitch-thi": "Thigh, to the side",
            "Yaw-thi": "Thigh, forward or back",
            "Roll-bac": "Back, forward or back",
            "Pitch-bac": "Back, to the side",
            "Yaw-bac": "Back, rotation about the spine",
        },
    ),
    (
        "Sensor position",
        {
            "LTib2Knee": "Shin sensor to knee",
            "Zr3S": "Shin sensor inward",
            "CTib": "Calf circumference",
            "LThi2Knee": "Thigh sensor to knee",
            "Zr4S": "Thigh sensor inward",
            "CThi": "Thigh circumference",
        },
    ),
    (
        "Body dimensions",
        {
            "Ltibia": "Shank length",
            "Yr3": "Knee forward of the shank's axis",
            "Zr3": "Knee inward of it",
            "Lthigh": "Thigh length",
            "Yr4": "Hip forward of the thigh's axis",
            "Zr4": "Hip inward of it",
            "PW": "Pelvis width",
            "PD": "Pelvis depth",
            "LL": "Leg length",
        },
    ),
)
"""The paper's names in words, by group."""


def summarise_sensitivity(
    legs: Mapping[Side, SensitivityTable], reference: str | None, *, from_standing: bool
) -> dict[str, Any]:
    """Convert to JSON types; `reference` = name of the reference, None = itself."""
    table = next(iter(legs.values()))
    steps = {row.unit: row.step for row in table.rows}
    summary = reduce_to_plain(
        {
            "schema": SCHEMA,
            "reference": reference,
            "from_standing": from_standing,
            "relative_pct": 100.0 * table.relative,
            "step_mm": 1000.0 * steps["m"],
            "step_deg": math.degrees(steps["rad"]),
            "angles": JOINTS,
            "legs": [
                {
                    "side": side,
                    "error_deg": np.degrees(leg.errors),
                    "average_pct": _average(leg.rows),
                    "rows": [_row(row) for row in leg.rows],
                }
                for side, leg in legs.items()
            ],
        }
    )
    assert isinstance(summary, dict)  # noqa: S101 (narrows the type; `reduce_to_plain` keeps mappings)
    return summary


def _average(rows: Sequence[SensitivityRow]) -> Floats:
    from sagittal.core.squat.sensitivity import average_sensitivity

    return average_sensitivity([row.sensitivity_pct for row in rows])


def _row(row: SensitivityRow) -> dict[str, object]:
    turned = row.unit == "rad"

    def in_unit(value: float | None) -> float | None:
        return math.degrees(value) if turned and value is not None else value

    return {
        "name": row.name,
        "nominal": in_unit(row.nominal),
        "unit": "deg" if turned else "m",
        "step": in_unit(row.step),
        "sensitivity_pct": row.sensitivity_pct,
        "delta_relative_deg": None if row.relative_rad is None else np.degrees(row.relative_rad),
        "delta_step_deg": np.degrees(row.absolute_rad),
        "reason": row.reason,
    }


def sensitivity_files(summary: Mapping[str, Any], stem: str) -> dict[str, bytes]:
    """File name → content."""
    return {
        f"{stem}.json": json.dumps(summary, ensure_ascii=False, allow_nan=False, indent=1).encode(),
        f"{stem}.csv": sensitivity_csv(summary),
    }


def sensitivity_csv(summary: Mapping[str, Any]) -> bytes:
    """One row per leg, parameter and angle; undefined values are empty."""

    def cells(values: list[float | None] | None, i: int) -> float | None:
        return None if values is None else values[i]

    def rows() -> Iterator[Sequence[object]]:
        for leg in summary["legs"]:
            for row in leg["rows"]:
                for i, angle in enumerate(summary["angles"]):
                    yield (
                        leg["side"], row["name"], angle, row["nominal"], row["unit"], leg["error_deg"][i],
                        cells(row["sensitivity_pct"], i), cells(row["delta_relative_deg"], i), row["step"],
                        cells(row["delta_step_deg"], i), row["reason"] or "",
                    )  # fmt: skip

    return write_csv(HEADER, rows())


def tell_sensitivity(summary: Mapping[str, Any]) -> list[str]:
    """Lines for a terminal: tables 2 and 3 in % if there is a reference, and changes in degrees."""
    lines: list[str] = []
    against = summary["reference"]
    share, steps = f"± {summary['relative_pct']:g} %", _say_steps(summary)
    for leg in summary["legs"]:
        lines.append(Message("{capitalize} leg", capitalize=leg["side"].capitalize()))
        if against is not None:
            errors = (f"{n} {e:.2f}" for n, e in zip(COLUMNS, leg["error_deg"], strict=True))
            lines += [Message("RMS error with nominal values, °: {errors}.", errors=", ".join(errors)), ""]
            for title, columns, averaged, name in TABLES:
                lines.append(
                    Message(
                        "{title}: sensitivity in %, mean of {share} of the nominal value",
                        title=title,
                        share=share,
                    )
                )
                rows = [(r["name"], _texts(r["sensitivity_pct"], columns, averaged, 1)) for r in leg["rows"]]
                rows.append(("Average", _texts(leg["average_pct"], columns, averaged, 1)))
                lines += _layout((*(COLUMNS[i] for i in columns), name), rows)
        heading = "Change of the RMS error in °" if against is not None else "RMS change of the angles in °"
        every = tuple(range(len(COLUMNS)))
        for title, member in (
            (f"{heading}, {share}", SHOWN["share"]),
            (Message("{heading}, by {steps}", heading=heading, steps=steps), SHOWN["step"]),
        ):
            lines.append(title)
            lines += _layout(COLUMNS, [(r["name"], _texts(r[member], every, (), 3)) for r in leg["rows"]])
    if any(row["reason"] for leg in summary["legs"] for row in leg["rows"]):
        lines.append("– : nominal value 0 or near a singularity; no relative change is defined.")
    lines.append("Tables: docs/science/squat.md. A quotient by an error below 0.1° is not given.")
    return lines


def _say_steps(summary: Mapping[str, Any]) -> str:
    return Message(
        "steps of {step_mm:g} mm and {step_deg:g}°", step_mm=summary["step_mm"], step_deg=summary["step_deg"]
    )


def _texts(
    values: Sequence[float | None] | None, columns: tuple[int, ...], averaged: tuple[int, ...], digits: int
) -> list[str]:
    """Cells of a row, followed by the average of some columns."""
    if values is None:
        return ["–"] * (len(columns) + bool(averaged))
    chosen = [values[i] for i in columns]
    if averaged:
        finite = [v for v in (values[i] for i in averaged) if v is not None]
        chosen.append(sum(finite) / len(finite) if finite else None)
    return ["–" if v is None else format_number(v, digits) for v in chosen]


def _layout(header: Sequence[str], rows: Sequence[tuple[str, list[str]]]) -> list[str]:
    lines = ["".join([f"{'':<12}", *(f"{name:>15}" for name in header)])]
    lines += ["".join([f"{name:<12}", *(f"{cell:>15}" for cell in cells)]) for name, cells in rows]
    return [*lines, ""]


@dataclass(frozen=True)
class SensitivityCell:
    """A number; `nothing` = it rounds to 0."""

    text: str
    nothing: bool


@dataclass(frozen=True)
class SensitivityLine:
    """A parameter in words, its name in the paper, its cells, and the reason if they are empty."""

    words: str
    name: str
    cells: tuple[SensitivityCell, ...]
    why: str


@dataclass(frozen=True)
class SensitivityLeg:
    """Tables 2 and 3 for one leg.

    Parameters
    ----------
    parts : title of each table and its columns. groups : title and lines. average : last line, None for
        quantities that are not ratios. errors : RMS errors against the reference in words, empty without one.
    """

    side: str
    parts: tuple[tuple[str, tuple[str, ...]], ...]
    groups: tuple[tuple[str, tuple[SensitivityLine, ...]], ...]
    average: tuple[SensitivityCell, ...] | None
    errors: str


@dataclass(frozen=True)
class SensitivityView:
    """Content of the page.

    Parameters
    ----------
    shown : one of `SHOWN`, and choices : (value, words) of those available.
    sentences : interpretation, the most important first.
    """

    reference: str | None
    shown: str
    choices: tuple[tuple[str, str], ...]
    unit: str
    sentences: tuple[str, ...]
    legs: tuple[SensitivityLeg, ...]


REASONS: Final[Mapping[str | None, str]] = {
    "parameter_nominal_zero": "its nominal value is 0",
    "gimbal": "near a singularity of its angles",
}


def view_sensitivity(content: bytes, selected: str) -> SensitivityView:
    """View of a {stem}.json; an unavailable `selected` is replaced by "step"."""
    summary = json.loads(content)
    choices: list[tuple[str, str]] = [
        (
            "step",
            Message(
                "{step_mm:g} mm and {step_deg:g}°", step_mm=summary["step_mm"], step_deg=summary["step_deg"]
            ),
        )
    ]
    choices.append(("share", f"± {summary['relative_pct']:g} %"))
    if summary["reference"] is not None:
        choices.append(("quotient", "Sensitivity in %"))
    selected = selected if selected in dict(choices) else "step"
    return SensitivityView(
        reference=summary["reference"],
        shown=selected,
        choices=tuple(choices),
        unit="%" if selected == "quotient" else "°",
        sentences=tuple(_speak(summary)),
        legs=tuple(
            _view_leg(leg, selected, against=summary["reference"] is not None) for leg in summary["legs"]
        ),
    )


def _speak(data: Mapping[str, Any]) -> Iterator[str]:
    """Most important parameters, and the smaller influence of the body."""
    largest = {title: _find_largest(data, names) for title, names in GROUPS}
    noun = "error changes" if data["reference"] is not None else "angle changes"
    turn, place, body = (largest[title] for title, _ in GROUPS)
    yield Message(
        "Sensor misalignment matters most: {step_deg:g}° changes an {noun} by up to {format_number}° "
        "({turn}).",
        step_deg=data["step_deg"],
        noun=noun,
        format_number=format_number(turn[0], 1),
        turn=turn[1],
    )
    yield Message(
        "A sensor displaced by {step_mm:g} mm: up to {format_number}°. A body dimension off by "
        "{step_mm2:g} mm: up to {format_number2}°.",
        step_mm=data["step_mm"],
        format_number=format_number(place[0], 2),
        step_mm2=data["step_mm"],
        format_number2=format_number(body[0], 2),
    )


def _find_largest(data: Mapping[str, Any], names: Mapping[str, str]) -> tuple[float, str]:
    """Largest change caused by a step, with angle and parameter in words."""
    most, location = -1.0, ""
    for leg in data["legs"]:
        for row in leg["rows"]:
            if row["name"] not in names:
                continue
            for i, value in enumerate(row["delta_step_deg"]):
                if value is not None and value > most:
                    angle = JOINTS[i].replace("_", " ")
                    most, location = value, f"{leg['side']} {angle}; {names[row['name']].lower()}"
    return most, location


def _view_leg(leg: Mapping[str, Any], selected: str, *, against: bool) -> SensitivityLeg:
    rows = {row["name"]: row for row in leg["rows"]}
    digits = 0 if selected == "quotient" else 2

    def cells(values: Sequence[float | None] | None) -> tuple[SensitivityCell, ...]:
        texts = [x for _, columns, averaged, _ in TABLES for x in _texts(values, columns, averaged, digits)]
        return tuple(SensitivityCell(x, not x.strip("0.–")) for x in texts)

    def line(name: str, words: str) -> SensitivityLine:
        reason = "" if selected == "step" else REASONS.get(rows[name]["reason"], "")
        return SensitivityLine(words, name, cells(rows[name][SHOWN[selected]]), reason)

    errors = (f"{n} {format_number(e, 1)}°" for n, e in zip(COLUMNS, leg["error_deg"], strict=True))
    return SensitivityLeg(
        side=leg["side"],
        parts=tuple((title, (*(COLUMNS[i] for i in columns), "Average")) for title, columns, _, _ in TABLES),
        groups=tuple((group, tuple(line(*entry) for entry in names.items())) for group, names in GROUPS),
        average=cells(leg["average_pct"]) if selected == "quotient" else None,
        errors=", ".join(errors) if against else "",
    )
