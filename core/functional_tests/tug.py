"""Timed up and go: its five segments (docs/science/timed-tests.md, "Timed up and go")."""

from __future__ import annotations

from math import degrees, radians
from typing import Final

from sagittal.core.errors import Notice
from sagittal.core.events.turns import Turn, TurnParams, find_turns
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
from sagittal.core.parameters.catalogue.entry import TUG
from sagittal.core.plurals import plural
from sagittal.core.signals.recording import GivenLimits

HALF_TURN: Final = radians(120.0)
"""Least angle of a turn around the mark, and of the one before the chair (our choice)."""

NAMES: Final = list_names(TUG, "take")

ONCE_MORE: Final = "The person rises once more after this test; only the first is measured."
AGAIN: Final = "The person rises {n} more times after this test; only the first is measured."


def measure_tug(
    trunk: TrunkMotion,
    limits: GivenLimits | None = None,
    rising: RisingParams | None = None,
    turning: TurnParams | None = None,
) -> FunctionalTest:
    """Detect and measure a timed up and go test.

    Returns
    -------
    FunctionalTest; parameters have no value and the reason "no_rise" without a rise, "no_sit_down" without
    sitting down again, "turn_missing" with fewer than two half turns in between.
    """
    limits = limits or GivenLimits()
    changes = [c for c in find_changes(trunk, rising) if _inside(c, limits)]
    turns = find_turns(trunk.yaw_rate, trunk.valid, trunk.rate_hz, turning)
    turns = tuple(t for t in turns if abs(t.angle_rad) >= HALF_TURN)
    rise, down = _choose(changes, turns)
    start = limits.start_s if limits.start_s is not None else None if rise is None else rise.start_s
    end = limits.end_s if limits.end_s is not None else None if down is None else down.end_s
    corrected = limits.start_s is not None or limits.end_s is not None
    if start is None or end is None:
        reason = "no_rise" if start is None else "no_sit_down"
        return FunctionalTest(start, end, (), state_figures({}, NAMES, reason), trunk.segment, corrected)

    values: dict[str, float | None] = {"tug_duration_s": end - start}
    if rise is not None:
        values |= {
            "tug_sit_to_stand_s": rise.end_s - start,
            "tug_rise_lean_deg": degrees(rise.lean_rad),
            "tug_rise_velocity_dps": degrees(rise.back_rad_s),
        }
    if down is not None:
        values["tug_stand_to_sit_s"] = end - down.start_s
    inner_turns = [t for t in turns if start < t.start_s and t.start_s < end]
    if len(inner_turns) > 2:
        # the way to the mark has one turn: the last one is before the chair
        inner_turns = [max(inner_turns[:-1], key=lambda t: abs(t.angle_rad)), inner_turns[-1]]
    segments: tuple[TimedSegment, ...] = ()
    if rise is not None and len(inner_turns) == 2:
        first, last = inner_turns
        segments = _cut(start, end, rise, first, last)
        values |= {f"tug_{s.name}_s": s.duration_s for s in segments}
        values |= {
            "tug_turn_velocity_dps": degrees(first.peak_rad_s),
            "tug_final_turn_s": last.duration_s,
            "tug_final_turn_velocity_dps": degrees(last.peak_rad_s),
        }
    more = sum(c.kind == SIT_TO_STAND and c.start_s >= end for c in changes)
    message = plural(more, ONCE_MORE, Message(AGAIN, n=more))
    notices = (Notice("more_tests", message, severity="info"),) if more else ()
    rows = state_figures(values, NAMES, "turn_missing" if len(inner_turns) < 2 else "no_rise")
    return FunctionalTest(start, end, segments, rows, trunk.segment, corrected, notices)


def _cut(start: float, end: float, rise: PostureChange, first: Turn, last: Turn) -> tuple[TimedSegment, ...]:
    """The five segments; the walk out has zero duration if the turn starts before rising has ended."""
    marks = [start, rise.end_s, first.start_s, first.end_s, last.start_s, end]
    for i in range(1, len(marks)):
        marks[i] = max(marks[i], marks[i - 1])
    names = ("sit_to_stand", "walk_out", "turn", "walk_back", "turn_to_sit")
    return tuple(TimedSegment(n, a, b) for n, a, b in zip(names, marks[:-1], marks[1:], strict=True))


def _inside(change: PostureChange, limits: GivenLimits) -> bool:
    """Whether the fastest moment of a transition is within the manually given limits."""
    low = -1.0 if limits.start_s is None else limits.start_s
    return low < change.fastest_s and (limits.end_s is None or change.fastest_s < limits.end_s)


def _choose(
    changes: list[PostureChange], turns: tuple[Turn, ...]
) -> tuple[PostureChange | None, PostureChange | None]:
    """The first rise and the next sitting down with a half turn in between; else the first rise."""
    rises = [c for c in changes if c.kind == SIT_TO_STAND]
    for rise in rises:
        down = next((c for c in changes if c.kind == STAND_TO_SIT and c.start_s >= rise.end_s), None)
        if down is not None and any(rise.start_s < t.start_s < down.end_s for t in turns):
            return rise, down
    first = rises[0] if rises else None
    earliest_s = -1.0 if first is None else first.end_s
    return first, next((c for c in changes if c.kind == STAND_TO_SIT and c.start_s >= earliest_s), None)
