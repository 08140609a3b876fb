"""Which training strides get feedback: a pure function of their number, so that it can be told beforehand."""

from __future__ import annotations

from dataclasses import dataclass

from sagittal.core.feedback.prescription import Schedule


@dataclass(frozen=True)
class ScheduleSlot:
    """A stride's place in a schedule.

    Parameters
    ----------
    shown : it gets feedback. share_pct : of the step of fading it lies in.
    block : number of its probe block, from 1; None in training.
    next_probe : training strides until the next block begins, itself included; None in a block or without.
    block_left : strides of its block, itself included; None in training.
    """

    shown: bool
    share_pct: int
    block: int | None
    next_probe: int | None
    block_left: int | None


def find_slot(schedule: Schedule, position: int) -> ScheduleSlot:
    """Where the stride of this number, from 0 and probes included, lies.

    Fading counts training strides only. Of every step exactly its share is shown, spread evenly: after k
    strides of a step with share p, ⌊k p⌋ were shown.
    """
    every, probes = schedule.probe_every, schedule.probe_strides
    trained, block, next_probe, left = position, None, None, None
    if every is not None:
        cycle, at = divmod(position, every + probes)
        trained = cycle * every + min(at, every)
        if at >= every:
            block, left = cycle + 1, every + probes - at
        else:
            next_probe = every - at
    share, index = _step(schedule, trained)
    shown = block is None and (index + 1) * share // 100 > index * share // 100
    return ScheduleSlot(shown, share, block, next_probe, left)


def _step(schedule: Schedule, trained: int) -> tuple[int, int]:
    """Share in % of the step of fading, and the stride's number in it."""
    if schedule.kind == "every":
        return 100, trained
    step = min(trained // schedule.strides_per_share, len(schedule.shares_pct) - 1)
    return schedule.shares_pct[step], trained - step * schedule.strides_per_share
