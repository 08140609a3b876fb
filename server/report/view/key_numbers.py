"""Key numbers of the overview, each with an explanation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from sagittal.core.message import Message
from sagittal.core.parameters.catalogue import require_entries
from sagittal.server.report.view.table import ParameterRow

KEY_NUMBERS: Final = (
    "gait_speed_mps",
    "cadence_spm",
    "step_length_m",
    "knee_flexion_rom_deg",
    "stride_time_s",
    "stance_pct",
    "squat_depth_deg",
    "squat_knee_valgus_deg",
    "squat_hip_drop_m",
    "squat_duration_s",
    "daily_step_count",
    "daily_walking_min",
    "daily_sitting_min",
    "daily_rise_count",
)
"""Parameters for the overview, in this order of preference."""

require_entries(KEY_NUMBERS, "sagittal.server.report.view.key_numbers")

SHOWN_LARGE: Final = 4
"""Number displayed, of those measured."""


@dataclass(frozen=True)
class KeyNumber:
    """One key number, or a left-right pair, with an explanation."""

    name: str
    title: str
    unit: str
    pair: bool
    text: str
    left: str
    right: str
    words: str


def choose_key_numbers(rows: Sequence[ParameterRow]) -> tuple[KeyNumber, ...]:
    """The first of KEY_NUMBERS that were measured reliably."""
    candidates = (r for name in KEY_NUMBERS for r in rows if r.name == name)
    return tuple(_key_number(r) for r in candidates if r.reason is None and not r.low_confidence)[
        :SHOWN_LARGE
    ]


def _key_number(row: ParameterRow) -> KeyNumber:
    pair = row.both is None
    norm = Message("norm {norm}", norm=row.norm) if row.norm else ""
    cells = {"": row.both} if row.both is not None else {" left": row.left, " right": row.right}
    few = ", ".join(f"{c.few}{side}" for side, c in cells.items() if c is not None and c.few)
    return KeyNumber(
        name=row.name,
        title=row.title,
        unit=row.unit,
        pair=pair,
        text="" if row.both is None else row.both.text,
        left="–" if row.left is None else row.left.text,
        right="–" if row.right is None else row.right.text,
        words=", ".join(w for w in (say_plus_minus(row), few, row.difference, norm) if w),
    )


def say_plus_minus(row: ParameterRow) -> str:
    """Uncertainty: "± 0.02", "± 4 | 5" if it differs between sides, "± 4 | –" for one side."""
    cells = (row.both,) if row.both is not None else (row.left, row.right)
    texts = ["" if c is None else c.plus_minus for c in cells]
    if not any(texts):
        return ""
    if len(set(texts)) == 1:
        return texts[0]
    return f"± {' | '.join(x.removeprefix('± ') or '–' for x in texts)}"
