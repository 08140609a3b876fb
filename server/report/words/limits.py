"""Comparison of values with limits and the sources of the limits; not a diagnosis (docs/science/flags.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from sagittal.core.flags import RULES, Flag
from sagittal.server.report.words.wording import format_number, reason_words

NAMES: Final[Mapping[str, str]] = {
    "stiff_knee": "Peak knee flexion in swing vs other side",
    "low_knee_flexion_swing": "Peak knee flexion in swing",
    "knee_hyperextension": "Minimum knee flexion in stance",
    "low_dorsiflexion_swing": "Peak dorsiflexion in swing",
    "flat_contact": "Foot pitch at contact",
    "low_toe_clearance": "Minimum toe clearance",
    "circumduction": "Circumduction",
    "hip_hiking": "Pelvic elevation in swing",
    "low_hip_extension": "Peak hip extension",
    "hip_range_asymmetry": "Hip range vs other side",
    "knee_range_asymmetry": "Knee range vs other side",
    "ankle_range_asymmetry": "Ankle range vs other side",
    "step_length_asymmetry": "Longer step over shorter step",
    "stance_asymmetry": "Longer stance over shorter stance",
    "swing_asymmetry": "Longer swing over shorter swing",
    "temporal_asymmetry": "Swing over stance, larger side over smaller",
}
"""Rule → measured quantity."""

if _unnamed := {rule.name for rule in RULES} - set(NAMES):
    raise ValueError(f"server.report.limits has no words for the rules {', '.join(sorted(_unnamed))}.")

NOTES: Final[Mapping[str, str]] = {
    "sides_stand_differently": "includes a difference in standing posture",
}

REASONS: Final[Mapping[str, str]] = {
    "angle_zero_standing": "requires goniometer angles in standing",
    "no_controls": "requires this clinic's own controls",
    "side_missing": "the other side is missing",
    "near_zero": "a side is near zero",
    "no_norm_for_age": "the limit applies to adults",
    "no_speed_matched_norm": "no norm at this walking speed",
    "too_few_strides": "too few strides to assess",
    "sides_alike": "strides and measurement error do not show a difference between sides",
}
"""Why a value cannot be compared with its limit; other codes as in the table."""

UNITS: Final[Mapping[str, tuple[str, int]]] = {"deg": ("°", 0), "m": ("\u202fm", 3), "": ("", 2)}


@dataclass(frozen=True)
class LimitRow:
    """One rule for one side.

    Parameters
    ----------
    measure : name of the measured quantity.
    kind : "warn" outside the limit, "bad" outside a second one, "ok" within, "none" not assessable.
    """

    name: str
    measure: str
    side: str
    value: str
    limit: str
    kind: str
    source: str
    note: str


@dataclass(frozen=True)
class LimitsView:
    """Rows outside their limits, rows within, and rows that cannot be assessed."""

    beyond: tuple[LimitRow, ...]
    within: tuple[LimitRow, ...]
    unknown: tuple[LimitRow, ...]


def limits_view(flags: Sequence[Flag]) -> LimitsView:
    """All rules, those outside their limit first."""
    rows = [_row(f) for f in flags]
    return LimitsView(
        beyond=tuple(r for r in rows if r.kind in ("warn", "bad")),
        within=tuple(r for r in rows if r.kind == "ok"),
        unknown=tuple(r for r in rows if r.kind == "none"),
    )


def _row(f: Flag) -> LimitRow:
    unit, digits = UNITS.get(f.unit, (f"\u202f{f.unit}", 2))
    words = [NOTES.get(f.note, f.note)] if f.note is not None else []
    if f.exceeded is None:
        words.append(REASONS.get(f.reason or "", reason_words(f.reason).removeprefix("not measured: ")))
    if not f.verified:
        words.append("unverified cut-off")
    sign = "≤" if f.beyond == "above" else "≥"
    kind = "none" if f.exceeded is None else "bad" if f.marked else "warn" if f.exceeded else "ok"
    return LimitRow(
        name=NAMES.get(f.name, f.name.replace("_", " ").capitalize()),
        measure=f.measure,
        side=f.side or "",
        value="–" if f.value is None else f"{format_number(f.value, digits)}{unit}",
        limit="" if f.limit is None else f"{sign} {format_number(f.limit, digits)}{unit}",
        kind=kind,
        source=f.source,
        note="; ".join(words),
    )
