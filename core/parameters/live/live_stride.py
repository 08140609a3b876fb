"""A stride as reported in real time. Plain values: nothing here imports numba."""

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
    """One cycle of a foot, reported as soon as its second contact is known.

    The same stride (same `n`) is reported again when the time of that contact is refined, within 0.2 s: its
    times and phases change by a few hundredths of a second. Distances require the rest of the foot after the
    contact: values with the reason `not_yet` are reported once more when available, at the latest with the
    foot's next contact, and the stride is then `complete`. After that no value changes any more.

    Parameters
    ----------
    n : running number over both feet, from 0. detected_s : last sample required.
    values : parameters of a stride as in the stride table (sagittal.core.parameters: temporal, spatial,
        stance, phases, kinematic), None if undefined. reasons : for every None.
    curves : variable → (101,) rad over the cycle, as `cycle_curves`; only complete ones.
    turn_rad : heading change of the foot, left positive. flags : those known by then; "first" of a bout and
        "near_turn" after a turn from the start, "last" and "in_place" when it is `complete`. counted : no
        flag.
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
