"""Five times sit-to-stand test (docs/science/timed-tests.md, "Five times sit to stand")."""

from __future__ import annotations

from math import degrees
from typing import Final

import numpy as np

from sagittal.core.errors import Notice
from sagittal.core.functional_tests.result import FunctionalTest, TimedSegment, state_figures
from sagittal.core.functional_tests.rising import (
    SIT_TO_STAND,
    STAND_TO_SIT,
    PostureChange,
    RisingParams,
    find_changes,
)
from sagittal.core.functional_tests.trunk import TrunkMotion
from sagittal.core.message import Message
from sagittal.core.parameters.catalogue import list_names
from sagittal.core.parameters.catalogue.entry import CHAIR
from sagittal.core.plurals import plural
from sagittal.core.signals.recording import GivenLimits

RISES: Final = 5

NAMES: Final = list_names(CHAIR, "take")

LONGEST_S: Final = 10.0
"""A longer time on the chair between two rises ends the test (our choice)."""


def measure_chair_rises(
    trunk: TrunkMotion, limits: GivenLimits | None = None, rising: RisingParams | None = None
) -> FunctionalTest:
    """Detect five consecutive rises and measure them.

    Clinics end the test either seated or with the fifth standing position: `five_sit_to_stand_s` ends seated,
    `five_sit_to_stand_standing_s` standing.

    Returns
    -------
    FunctionalTest; parameters have no value and the reason "no_rise" without a rise, "too_few_rises" with
    fewer than five consecutive ones.
    """
    limits = limits or GivenLimits()
    low = -1.0 if limits.start_s is None else limits.start_s
    high = np.inf if limits.end_s is None else limits.end_s
    changes = [c for c in find_changes(trunk, rising) if low < c.fastest_s < high]
    rises = _row([c for c in changes if c.kind == SIT_TO_STAND])
    corrected = limits.start_s is not None or limits.end_s is not None
    start = limits.start_s if limits.start_s is not None else rises[0].start_s if rises else None
    if len(rises) < RISES:
        segments = _segments(rises, changes)
        end = limits.end_s
        is_complete = start is not None and end is not None and rises
        reason = "too_few_rises" if rises else "no_rise"
        count = {"chair_rise_count": float(len(rises))} if is_complete else {}
        rows = state_figures(count, NAMES, reason)
        return FunctionalTest(start, end, segments, rows, trunk.segment, corrected)
    rises = rises[:RISES]
    segments = _segments(rises, changes)
    down = segments[-1] if segments[-1].name == STAND_TO_SIT else None
    end = limits.end_s if limits.end_s is not None else None if down is None else down.end_s
    begin = rises[0].start_s if start is None else start
    times = np.array([r.duration_s for r in rises])
    values: dict[str, float | None] = {
        "five_sit_to_stand_s": None if end is None else end - begin,
        "five_sit_to_stand_standing_s": rises[-1].end_s - begin,
        "chair_rise_count": float(RISES),
        "chair_rise_s": float(times.mean()),
        "chair_rise_slowing_pct": 100.0 * float(times[-1] / times[0] - 1.0),
        "chair_rise_lean_deg": degrees(float(np.mean([r.lean_rad for r in rises]))),
        "chair_rise_velocity_dps": degrees(float(np.mean([r.back_rad_s for r in rises]))),
    }
    sitting = [s.duration_s for s in segments if s.name == STAND_TO_SIT]
    values["chair_sit_down_s"] = float(np.mean(sitting)) if sitting else None
    more = len(_row([c for c in changes if c.kind == SIT_TO_STAND])) - RISES
    notices = (
        (
            Notice(
                "more_rises",
                Message(
                    f"{{more}} more {plural(more, 'rise follows', 'rises follow')}; the first five are "
                    "measured.",
                    more=more,
                ),
                severity="info",
            ),
        )
        if more > 0
        else ()
    )
    rows = state_figures(values, NAMES, "no_sit_down")
    return FunctionalTest(begin, end, segments, rows, trunk.segment, corrected, notices)


def _row(rises: list[PostureChange]) -> list[PostureChange]:
    """The longest sequence of rises without a long pause."""
    best: list[PostureChange] = []
    row: list[PostureChange] = []
    for rise in rises:
        if row and rise.start_s - row[-1].end_s > LONGEST_S:
            row = []
        row.append(rise)
        if len(row) > len(best):
            best = list(row)
    return best


def _segments(rises: list[PostureChange], changes: list[PostureChange]) -> tuple[TimedSegment, ...]:
    """Rises, and the sitting down between and after them."""
    if not rises:
        return ()
    last = next((c for c in changes if c.kind == STAND_TO_SIT and c.start_s >= rises[-1].fastest_s), None)
    end = rises[-1].end_s if last is None else last.end_s
    part = [c for c in changes if rises[0].start_s <= c.start_s and c.end_s <= end]
    return tuple(TimedSegment(c.kind, c.start_s, c.end_s) for c in part)
