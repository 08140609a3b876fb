"""Selection of training strides with feedback: a pure function of their number, so that it is known in
advance.
"""

from __future__ import annotations

from dataclasses import dataclass

from sagittal.core.feedback.prescription import Schedule


@dataclass(frozen=True)
class ScheduleSlot:
    """Position of a stride in a schedule.

    Parameters
    ----------
    shown : feedback is given. share_pct : of its fading step.
    block : number of its probe block, from 1; None in training.
    next_probe : training strides until the next block, itself included; None in a block or without blocks.
    block_left : remaining strides of its block, itself included; None in training.
    """

    shown: bool
    share_pct: int
    block: int | None
    next_probe: int | None
    block_left: int | None


def find_slot(schedule: Schedule, position: int) -> ScheduleSlot:
    """Position of a stride by its number, from 0 and including probes.

    Fading counts training strides only. In every step exactly its percentage is shown, spread evenly: after k
    strides of a step with share p, ⌊k p⌋ were shown.
    """
    every, probes = schedule.probe_every, schedule.probe_strides
    trained, block, next_probe, left = position, None, None, None
    if every is not None:
        cycle, place = divmod(position, every + probes)
        trained = cycle * every + min(place, every)
        if place >= every:
            block, left = cycle + 1, every + probes - place
        else:
            next_probe = every - place
    share, index = _step(schedule, trained)
    is_shown = block is None and (index + 1) * share // 100 > index * share // 100
    return ScheduleSlot(is_shown, share, block, next_probe, left)


def _step(schedule: Schedule, trained: int) -> tuple[int, int]:
    """Percentage of the fading step, and the stride's number in it."""
    if schedule.kind == "every":
        return 100, trained
    step = min(trained // schedule.strides_per_share, len(schedule.shares_pct) - 1)
    return schedule.shares_pct[step], trained - step * schedule.strides_per_share
