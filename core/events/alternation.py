"""Timing consistency of left and right foot, from their double supports if nothing else links them.

If the clock of one foot is late by τ, both its contact and its foot-off are late: the double support after
the other foot's contact grows by τ and the other one shrinks by τ. A limp with unequal stance or swing
changes neither much (docs/science/agreement.md, "Feet alone").
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.errors import Notice
from sagittal.core.events.result import GaitEvents
from sagittal.core.frames import SIDES, Floats, Segment, Side
from sagittal.core.message import Message

FURTHEST_S: Final = 0.45
"""A lift further from a contact belongs to another step."""


@dataclass(frozen=True)
class AlternationParams:
    """Criteria for a clock offset between the two feet.

    Parameters
    ----------
    least_s : half the difference of the two double supports. 22 walks of healthy people (ipol_walks, manually
        verified events) have up to 0.010 s, simulated patients up to 0.045 s (antalgic).
    note_s : threshold for a notice that a limp and a wrong clock cannot be distinguished.
    least_steps : minimum number of steps of either kind.
    """

    least_s: float = 0.060
    note_s: float = 0.025
    least_steps: int = 4


def measure_foot_lag(events: GaitEvents, params: AlternationParams) -> float | None:
    """Apparent delay of the right foot relative to the left one, s; None with too few steps."""
    lags: dict[Side, Floats] = {}
    for side, opposite in zip(SIDES, reversed(SIDES), strict=True):
        contact, lift = np.array(events.times(side, "ic")), np.sort(events.times(opposite, "tc"))
        if not len(contact) or not len(lift):
            return None
        # the lifts before and after; all pairs would take gigabytes of a take of hours
        next_one = np.searchsorted(lift, contact)
        previous_lag = lift[np.maximum(next_one - 1, 0)] - contact
        next_lag = lift[np.minimum(next_one, len(lift) - 1)] - contact
        nearest = np.where(np.abs(previous_lag) <= np.abs(next_lag), previous_lag, next_lag)
        lags[side] = nearest[np.abs(nearest) < FURTHEST_S]
        if len(lags[side]) < params.least_steps:
            return None
    return 0.5 * float(np.median(lags["left"]) - np.median(lags["right"]))


def tell_foot_lag(events: GaitEvents, params: AlternationParams) -> tuple[Notice, ...]:
    """Notice on an apparent delay of one foot, if any."""
    lag = measure_foot_lag(events, params)
    if lag is None or abs(lag) <= params.note_s:
        return ()
    late: Segment = "foot_r" if lag > 0 else "foot_l"
    if abs(lag) <= params.least_s:
        return (
            Notice(
                "feet_out_of_time",
                Message(
                    "The two double-support phases differ by {abs:.0f} ms. The cause may be a limp or a "
                    "clock that is {abs2:.0f} ms late. No sensor between the feet can tell them apart: "
                    "the ± of step times allows for both.",
                    abs=2000 * abs(lag),
                    abs2=1000 * abs(lag),
                ),
                late,
                severity="info",
            ),
        )
    return (
        Notice(
            "feet_out_of_time",
            Message(
                "The two double-support phases differ by {abs:.0f} ms: the "
                f"{'right' if lag > 0 else 'left'} foot appears to be {{abs2:.0f}} ms late. This "
                "indicates a clock offset, rarely a severe limp. Step times and double support are "
                "unreliable; synchronise the sensors.",
                abs=2000 * abs(lag),
                abs2=1000 * abs(lag),
            ),
            late,
        ),
    )
