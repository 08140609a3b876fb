"""A stride as it is told while samples come. Plain values: nothing here imports numba."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from sagittal.core.events.result import StrideFlag
from sagittal.core.frames import Floats, Side

NOT_YET: Final = "not_yet"
"""Reason of a value that a later `LiveStride` of the same stride will have."""


@dataclass(frozen=True, eq=False)
class LiveStride:
    """One cycle of a foot, told as soon as its second contact is known.

    The same stride (same `n`) is told again when the time of that contact is refined, within 0.2 s: its times
    and shares change by a few hundredths of a second. Distances need the rest of the foot after the contact:
    where a reason is `not_yet`, it is told once more when they are known, at the latest with the foot's next
    contact, and is then `complete`. Then no value changes any more.

    Parameters
    ----------
    n : running number over both feet, from 0. detected_s : last sample that was needed.
    values : parameters of a stride as in the stride table (sagittal.core.parameters: temporal, spatial,
        stance, phases, kinematic), None where undefined. reasons : why, for every None.
    curves : variable → (101,) rad over the cycle, as `cycle_curves`; only those known throughout.
    turn_rad : heading change of the foot, left positive. flags : those that are known by then; "first" of a
        bout and "near_turn" after a turn from the start, "last" and "in_place" when it is `complete`.
        counted : no flag.
    """

    n: int
    side: Side
    start_s: float
    foot_off_s: float | None
    end_s: float
    detected_s: float
    values: Mapping[str, float | None]
    reasons: Mapping[str, str]
    curves: Mapping[str, Floats]
    turn_rad: float | None
    flags: tuple[StrideFlag, ...]
    counted: bool
    complete: bool
