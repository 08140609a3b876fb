"""Contacts → walking bouts, and the stops inside and between them.

A bout is walking without a long break; a single shuffle of the feet is none. Definitions and the two limits:
docs/science/strides.md, "Walking bouts" (mobgap's rules as implemented: at least 4 strides in total, breaks
of at most 3 s). An overlong step is a break in the sequence of contacts: a contact was missed, or the person
stopped. It is called a stop only if the sensors show quiet standing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, pairwise
from math import inf

import numpy as np

from sagittal.core.events.result import GaitEvents
from sagittal.core.frames import SIDES
from sagittal.core.signals.rest import Window


@dataclass(frozen=True)
class WalkParams:
    """Criteria for walking.

    Parameters
    ----------
    break_s : longest time between two contacts of a bout. min_strides : minimum number of strides in a bout,
        counting both feet (mobgap).
    """

    break_s: float = 3.0
    min_strides: int = 4


@dataclass(frozen=True)
class RowParams(WalkParams):
    """Criteria for breaks between steps.

    Parameters
    ----------
    long_share : a step longer than this multiple of the median step of its bout is a break. Our choice: the
        steps of the simulated patients stay below 1.7, including gait initiation and termination.
    """

    long_share: float = 2.0


@dataclass(frozen=True)
class BoutParams(RowParams):
    """Criteria for stops.

    Parameters
    ----------
    long_s : shortest break, so that fast walking has none. Our choice.
    stand_s : minimum standing time in a break to call it a stop; one stride more with one foot known, since a
        foot is at rest in every stride. Our choice: both feet are never at rest together for this long in
        walking (ipol_walks, gaitmap_foot, neura_walk, all simulated patients).
    near_s : a rest this close to the end of a bout is its start or end. Our choice: the longest rest that the
        quiet window of 1 s cannot detect (core/signals/rest.py) plus one step.
    """

    long_s: float = 1.0
    stand_s: float = 0.5
    near_s: float = 2.0


@dataclass(frozen=True)
class Bout:
    """Walking without a long break.

    Parameters
    ----------
    start_s : first foot-off, or the first contact if the foot-off is unknown.
    first_s, end_s : first and last contact. contacts : number of contacts, of both feet.
    step_s : median time between contacts; with one foot known, of its strides.
    breaks : half-open ranges between two contacts too far apart for one step. stops : those with quiet
        standing.
    from_rest, to_rest : quiet standing before and after; None if rest is unknown.
    """

    start_s: float
    first_s: float
    end_s: float
    contacts: int
    step_s: float
    breaks: tuple[Window, ...] = ()
    stops: tuple[Window, ...] = ()
    from_rest: bool | None = None
    to_rest: bool | None = None

    @property
    def duration_s(self) -> float:
        """From the first foot-off to the last contact, s."""
        return self.end_s - self.start_s

    @property
    def initiation_s(self) -> float | None:
        """Gait initiation: first foot-off to first contact, s; None unless the bout starts from rest with a
        known foot-off.
        """
        return self.first_s - self.start_s if self.from_rest and self.first_s > self.start_s else None


def walking_bouts(
    contacts: Sequence[float],
    leavings: Sequence[float] = (),
    rests: Sequence[Window] | None = None,
    feet: int = 2,
    params: BoutParams | None = None,
    standing: Sequence[Window] = (),
) -> tuple[Bout, ...]:
    """Walking bouts from contacts in chronological order.

    Parameters
    ----------
    contacts, leavings : initial and terminal contacts of all known feet, s, increasing.
    rests : windows of rest, None if unknown. feet : number of feet with contacts.
    standing : windows without movement of the feet; stops are reported only within these.
    """
    params = params or BoutParams()
    bouts = []
    ended = -inf
    for run in _walks(contacts, feet, params):
        steps = np.diff(run)
        typical = float(np.median(steps))
        limit = max(params.long_s, params.long_share * typical)
        breaks = tuple((a, b) for a, b in pairwise(run) if b - a > limit)
        # one foot stands still in every stride
        least = params.stand_s + (0.0 if feet == 2 else typical)
        start = next((t for t in leavings if max(ended, run[0] - params.break_s) < t < run[0]), run[0])
        ended = run[-1]
        bouts.append(
            Bout(
                start_s=start,
                first_s=run[0],
                end_s=run[-1],
                contacts=len(run),
                step_s=typical,
                breaks=breaks,
                stops=tuple(x for x in breaks if any(_overlap(x, w) >= least for w in standing)),
                from_rest=_touches(rests, start, params.near_s, ends_before=True),
                to_rest=_touches(rests, run[-1], params.near_s, ends_before=False),
            )
        )
    return tuple(bouts)


def plain_bouts(contacts: Sequence[float], params: WalkParams) -> tuple[Bout, ...]:
    """Walking bouts from contacts of two feet, without breaks and rests."""
    return tuple(
        Bout(run[0], run[0], run[-1], len(run), float(np.median(np.diff(run))))
        for run in _walks(contacts, 2, params)
    )


def find_bouts(
    events: GaitEvents,
    rests: Sequence[Window] | None = None,
    params: BoutParams | None = None,
    standing: Sequence[Window] = (),
) -> tuple[Bout, ...]:
    """Walking bouts from the contacts of the feet; arguments as in `walking_bouts`."""
    of_feet = [events.times(side, "ic") for side in SIDES]
    contacts = sorted(chain(*of_feet))
    leavings = sorted(chain(*(events.times(side, "tc") for side in SIDES)))
    feet = sum(bool(times) for times in of_feet)
    return walking_bouts(contacts, leavings, rests, max(1, feet), params, standing)


def _walks(contacts: Sequence[float], feet: int, params: WalkParams) -> list[list[float]]:
    """Sequences of contacts without a long break, long enough for walking."""
    runs: list[list[float]] = []
    for t in contacts:
        if runs and t - runs[-1][-1] <= params.break_s:
            runs[-1].append(t)
        else:
            runs.append([t])
    least = params.min_strides if feet == 2 else params.min_strides // 2
    return [run for run in runs if len(run) - feet >= least]


def _overlap(first: Window, second: Window) -> float:
    """Overlap of two ranges, s."""
    return min(first[1], second[1]) - max(first[0], second[0])


def _touches(rests: Sequence[Window] | None, t: float, near_s: float, *, ends_before: bool) -> bool | None:
    """Whether a rest ends shortly before t (`ends_before`), or starts shortly after it."""
    if rests is None:
        return None
    return any(-0.5 <= (t - end if ends_before else start - t) <= near_s for start, end in rests)
