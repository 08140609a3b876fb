"""View of a filter comparison: sentences, table, charts, and reference."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from sagittal.core.frames import SEGMENTS, SIDES, SUFFIX, Floats, Side
from sagittal.core.fusion.algorithms.listed import ENGINES
from sagittal.core.message import Message, read_message
from sagittal.core.plurals import plural
from sagittal.server.report.charts.filter_charts import Over, draw_agreement, draw_spread
from sagittal.server.report.words.filter_list import GRADES_IN_WORDS
from sagittal.server.report.words.wording import VARIABLES, format_number, place_words

NAME: Final = "filters.json"

PARTS: Final = ("pelvis", "chest", "thigh", "shank", "foot")
QUANTITIES: Final = {"inclination": "Inclination of segments", "heading": "Heading of segments"}

HEADLINE: Final = (
    ("knee_flexion", "", "knee flexion"),
    ("hip_flexion", "", "hip flexion"),
    ("ankle_dorsiflexion", "", "ankle dorsiflexion"),
    ("foot", "_inclination", "inclination of the foot"),
    ("pelvis", "_inclination", "inclination of the pelvis"),
)
"""Quantity of the sentence, the first available: name, ending, words."""

CLEAR: Final = 1.05
"""Margin above the highest curve."""


@dataclass(frozen=True)
class SpreadPanel:
    """One chart; `numbers` = side letter or "", and the RMS over the trial in degrees."""

    title: str
    svg: str
    numbers: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class SpreadRow:
    """Table row for one side of a quantity: degrees as text, over the trial, in stance, in swing, maximum."""

    title: str
    side: Side | None
    numbers: tuple[str, ...]


@dataclass(frozen=True)
class FilterRow:
    """Table row of a filter; numbers are texts, "" if missing; told = error message."""

    name: str | None
    label: str
    engine: str
    grade: str
    cost: str
    to_median: tuple[str, str]
    to_own: tuple[str, str]
    told: tuple[str, ...]


@dataclass(frozen=True)
class ReferenceRow:
    """A filter compared with the reference in the selected quantity: degrees as text."""

    name: str | None
    label: str
    errors: tuple[str, ...]
    shown: bool


@dataclass(frozen=True)
class ReferenceView:
    """Comparison with the reference.

    Parameters
    ----------
    choices : (value, words, chosen) of available quantities. heads : column headings of the table.
    """

    source: str
    sentences: tuple[str, ...]
    choices: tuple[tuple[str, str, bool], ...]
    of: str
    heads: tuple[str, ...]
    rows: tuple[ReferenceRow, ...]
    figures: tuple[tuple[str, str], ...]
    figure_of: str


@dataclass(frozen=True)
class ComparisonView:
    """Content of the page for one comparison."""

    headline: str
    sentences: tuple[str, ...]
    rows: tuple[FilterRow, ...]
    over: Over
    groups: tuple[tuple[str, tuple[SpreadPanel, ...]], ...]
    table: tuple[SpreadRow, ...]
    reference: ReferenceView | None


def view_comparison(
    content: bytes, over: Over, quantity: str | None = None, filter_name: str | None = None
) -> ComparisonView:
    """View of a filters.json.

    Parameters
    ----------
    quantity : segment or joint angle compared with the reference. filter_name : filter to plot.
    """
    data: dict[str, Any] = json.loads(content)
    spreads = {s["name"]: s for s in data["spreads"]}
    end = data["t_s"][-1] if data["t_s"] else 1.0
    has_cycles = any(s["cycle_sd"] for s in data["spreads"])
    over = over if has_cycles else "time"
    ran = sum(f["to_median"] is not None for f in data["filters"]) - 1
    rows = tuple(_row(f) for f in data["filters"])
    drawn: Mapping[str, Any] = spreads
    if ran < 2:  # a single filter is its own median: 0° everywhere would look like agreement
        rows, drawn = tuple(replace(row, to_median=("", "")) for row in rows), {}
    return ComparisonView(
        headline=_headline(spreads, ran, len(data["segments"])),
        sentences=(*_notes(data, has_cycles), *(read_message(n) for n in data["notices"])),
        rows=rows,
        over=over,
        groups=(
            ("Joint angles", _panels([(v.label, _sides(drawn, v.name, "")) for v in VARIABLES], over, end)),
            *(
                (title, _panels([(p.capitalize(), _sides(drawn, p, f"_{q}")) for p in PARTS], over, end))
                for q, title in QUANTITIES.items()
            ),
        ),
        table=tuple(row for s in drawn.values() for row in _spread_rows(s)),
        reference=None if data["reference"] is None else _reference(data, quantity, filter_name),
    )


def _headline(spreads: Mapping[str, Any], ran: int, sensors: int) -> str:
    """Effect of the choice of filter, in one sentence."""
    filters, devices = (
        f"{n} {plural(n, word, f'{word}s')}" for n, word in ((ran, "filter"), (sensors, "sensor"))
    )
    for name, ending, words in HEADLINE:
        by_side = _sides(spreads, name, ending)
        if by_side and ran > 1:
            values = " and ".join(
                f"{format_number(s['rms'], 1)}° {side or ''}" for side, s in by_side.items()
            )
            return Message(
                "{filters} on {devices}: their {words} differs by {strip} (standard deviation).",
                filters=filters,
                devices=devices,
                words=words,
                strip=values.strip(),
            )
    if ran == 1:
        return Message(
            "{filters} on {devices}: there is no other filter to compare with, so it is compared with "
            "Sagittal's own.",
            filters=filters,
            devices=devices,
        )
    return Message("{filters} on {devices}.", filters=filters, devices=devices)


def _notes(data: Mapping[str, Any], has_cycles: bool) -> list[str]:
    used = "used by filters that support it" if data["magnetometer"] else "not used"
    cycle_counts = " and ".join(f"{data['strides'].get(side, 0)} {side}" for side in SIDES)
    cycles = (
        Message("Over the gait cycle: {cycle_counts} strides.", cycle_counts=cycle_counts)
        if has_cycles
        else "No strides included: over time only."
    )
    return [Message("Magnetometer: {used}. {cycles}", used=used, cycles=cycles)]


def _sides(spreads: Mapping[str, Any], name: str, ending: str) -> dict[Side | None, Any]:
    """Spreads of a quantity by side; None for a quantity without sides."""
    if name == "pelvis_rotation":
        name, ending = "pelvis", "_heading"
    if f"{name}{ending}" in spreads:
        return {None: spreads[f"{name}{ending}"]}
    return {side: spreads[key] for side in SIDES if (key := f"{name}_{SUFFIX[side]}{ending}") in spreads}


def _panels(
    quantities: Sequence[tuple[str, dict[Side | None, Any]]], over: Over, end: float
) -> tuple[SpreadPanel, ...]:
    """Charts of the known quantities, on a common value axis."""
    drawn = []
    for title, by_side in quantities:
        lines: dict[Side | None, Floats] = {}
        for side, s in by_side.items():
            curves = {side: s["sd"]} if over == "time" else s["cycle_sd"]
            for key, values in curves.items():
                lines[key] = np.array([np.nan if x is None else x for x in values])
        lines = {key: x for key, x in lines.items() if np.isfinite(x).any()}
        if lines:
            drawn.append((title, by_side, lines))
    top = max((float(np.nanmax(x)) for _, _, lines in drawn for x in lines.values()), default=0.0)
    return tuple(
        SpreadPanel(
            title,
            draw_spread(title, lines, max(CLEAR * top, 0.1), end, over),
            tuple(
                ("" if side is None else SUFFIX[side], format_number(s["rms"], 1))
                for side, s in by_side.items()
            ),
        )
        for title, by_side, lines in drawn
    )


def _spread_rows(s: Mapping[str, Any]) -> list[SpreadRow]:
    """One row per side; bilateral quantities have one for the cycles of each leg."""
    sides: list[Side | None] = list(s["stance"]) or [None]
    return [
        SpreadRow(
            name_quantity(s["name"]),
            None if side is None or len(sides) == 1 else side,
            tuple(_text(x) for x in (s["rms"], s["stance"].get(side), s["swing"].get(side), s["largest"])),
        )
        for side in sides
    ]


def _row(f: Mapping[str, Any]) -> FilterRow:
    def pair(score: Mapping[str, float] | None) -> tuple[str, str]:
        return ("", "") if score is None else (_text(score["inclination"]), _text(score["heading"]))

    problems = tuple(
        Message("{place}: {message}", place=place_words(n["sensor"]).capitalize(), message=read_message(n))
        if n["sensor"]
        else read_message(n)
        for n in f["told"]
    )
    engine = "" if f["engine"] is None else f"{f['engine']} {ENGINES[f['engine']]}"
    grade = "" if f["grade"] is None else GRADES_IN_WORDS[f["grade"]]
    cost = "" if f["cost_us"] is None else format_number(f["cost_us"], 2)
    return FilterRow(
        f["name"], f["label"], engine, grade, cost, pair(f["to_median"]), pair(f["to_own"]), problems
    )


def _text(value: float | None) -> str:
    return "" if value is None or not math.isfinite(value) else format_number(value, 1)


def _reference(data: Mapping[str, Any], item: str | None, filter_name: str | None) -> ReferenceView:
    r = data["reference"]
    pairs = {(b["filter"], b["quantity"]): b for b in r["agreement"]}
    scores = {(s["filter"], s["segment"]): s for s in r["scores"]}
    segments = [s for s in SEGMENTS if s in r["segments"]]
    joints = [q for q in dict.fromkeys(q for _, q in pairs) if not q.endswith(tuple(QUANTITIES))]
    names = {s: place_words(s).capitalize() for s in segments} | {q: name_quantity(q) for q in joints}
    chosen: str = item if item is not None and item in names else next(iter(names), "")
    labels = {f["name"]: f["label"] for f in data["filters"]}
    is_segment = chosen in segments
    quantities = [f"{chosen}_{q}" for q in QUANTITIES] if is_segment else [chosen]
    rows = []
    selected = filter_name if (filter_name, quantities[0]) in pairs else None
    for name, label in labels.items():
        errors: list[str] = []
        if is_segment:
            score = scores.get((name, chosen), {})
            errors += [_text(score.get(part)) for part in ("total", "inclination", "heading")]
        for quantity in quantities:
            b = pairs.get((name, quantity))
            if not is_segment:
                errors.append("" if b is None else _text(b["rmse"]))
            errors += (
                ["", ""]
                if b is None
                else [
                    _text(b["bias"]),
                    Message("{text} to {text2}", text=_text(b["low"]), text2=_text(b["high"])),
                ]
            )
        if any(errors):
            rows.append(ReferenceRow(name, label, tuple(errors), name == selected))
    figures = [
        (q.rpartition("_")[2].capitalize() if is_segment else names[chosen], _figure(pairs[selected, q], q))
        for q in quantities
        if (selected, q) in pairs
    ]
    limits = ("bias", "95 % limits")
    heads = (
        ("RMSE total", "inclination", "heading", *(f"{q} {x}" for q in QUANTITIES for x in limits))
        if is_segment
        else ("RMSE", *limits)
    )
    return ReferenceView(
        r["source"],
        tuple(read_message(n) for n in r["notices"]),
        tuple((value, words, value == chosen) for value, words in names.items()),
        names.get(chosen, ""),
        heads,
        tuple(rows),
        tuple(figures),
        labels.get(selected, ""),
    )


def _figure(b: Mapping[str, Any], quantity: str) -> str:
    return draw_agreement(
        quantity.replace("_", " "), b["middle"], b["difference"], [b["bias"], b["low"], b["high"]]
    )


def name_quantity(name: str) -> str:
    """Name of a quantity: "Knee flexion, left", "Left shank, heading"."""
    base, _, suffix = name.rpartition("_")
    if suffix in QUANTITIES:
        return f"{place_words(base).capitalize()}, {suffix}"
    side = next((s for s in SIDES if SUFFIX[s] == suffix), None)
    label = next((v.label for v in VARIABLES if v.name == (name if side is None else base)), name)
    return label if side is None else f"{label}, {side}"
