"""Walking bouts, turns and steps of a trunk sensor → parameters of the recording
(docs/reference/parameters.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sagittal.core.events.bouts import Bout
from sagittal.core.events.steps import EDGE_STEPS, Steps
from sagittal.core.events.turns import Turn
from sagittal.core.parameters.catalogue import unit_of
from sagittal.core.parameters.plausible import IMPOSSIBLE, is_impossible
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.temporal import cadence
from sagittal.core.parameters.variability import summarise_values
from sagittal.core.signals.rest import Window


def bout_parameters(bouts: Sequence[Bout]) -> tuple[Parameter, ...]:
    """Number and total duration of walking bouts."""
    n = len(bouts)
    minutes = sum(b.duration_s for b in bouts) / 60.0
    return (
        Parameter("walking_bout_count", None, n, float(n), None, ""),
        Parameter("walking_duration_min", None, n, minutes if n else None, None, "min", _none(n, "no_bouts")),
    )


def turn_parameters(turns: Sequence[Turn]) -> tuple[Parameter, ...]:
    """Turns to both sides: number, angle (without direction), duration, peak yaw rate."""
    angle = [float(np.degrees(abs(t.angle_rad))) for t in turns]
    peak = [float(np.degrees(t.peak_rad_s)) for t in turns]
    figures = {
        "turn_angle_deg": angle,
        "turn_duration_s": [t.duration_s for t in turns],
        "turn_peak_velocity_dps": peak,
    }
    return (
        Parameter("turn_count", None, len(turns), float(len(turns)), None, ""),
        # the note on few strides is none on turns
        *(
            replace(summarise_values(n, None, x, unit_of(n), "no_turns"), note=None)
            for n, x in figures.items()
        ),
    )


def step_strides(steps: Steps) -> tuple[Window, ...]:
    """Strides of one foot from the steps of a trunk sensor: two steady steps each, without a break."""
    strides: list[Window] = []
    for bout in steps.bouts:
        contacts = [s.time_s for s in steps.steps if bout.first_s <= s.time_s <= bout.end_s]
        steady = contacts[EDGE_STEPS : len(contacts) - EDGE_STEPS]
        breaks = [first for first, _ in bout.breaks]
        pairs = zip(steady[:-2:2], steady[2::2], strict=True)
        strides += [(a, b) for a, b in pairs if not any(a <= break_s < b for break_s in breaks)]
    return tuple(strides)


def step_parameters(steps: Steps) -> tuple[Parameter, ...]:
    """Cadence, step time and number of steps from a trunk sensor, both feet together.

    Steps belong to the whole recording: sides are determined for whole walks or not at all, and the two ends
    of a step have errors of different feet.
    """
    step_times = steps.step_times_s
    times = [t for t in step_times if not is_impossible("step_time_s", t)]
    reason = (
        None if times else next((n.code for n in steps.notices), IMPOSSIBLE if step_times else "no_strides")
    )
    step = summarise_values("step_time_s", None, times, "s", reason)
    n = len(steps.steps)
    return (cadence(step), step, Parameter("step_count", None, n, float(n), None, ""))


def _none(n: int, reason: str) -> str | None:
    return None if n else reason
