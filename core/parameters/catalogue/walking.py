"""Walking bouts, turns and steps of the whole recording (core/parameters/walking.py)."""

from __future__ import annotations

from typing import Final

from sagittal.core.parameters.catalogue.entry import DURATION, SIZE, WALKING, ParameterEntry

ENTRIES: Final = (
    ParameterEntry(
        "step_count",
        label="Steps",
        group=WALKING,
        digits=0,
        scale=(0, 1000),
        comparison=SIZE,
        definition="Steps found by the sensor on the trunk.",
        of="take",
        counted="steps",
    ),
    ParameterEntry(
        "walking_bout_count",
        label="Walks without a long break",
        group=WALKING,
        digits=0,
        scale=(0, 10),
        comparison=SIZE,
        definition="Parts of the take with at least four strides and no break longer than 3 s.",
        of="take",
        counted="bouts",
    ),
    ParameterEntry(
        "walking_duration_min",
        label="Time walked",
        group=WALKING,
        digits=1,
        scale=(0, 10),
        comparison=DURATION,
        definition="Time in these parts.",
        of="take",
        counted="bouts",
    ),
    ParameterEntry(
        "turn_count",
        label="Turns",
        group=WALKING,
        digits=0,
        scale=(0, 20),
        comparison=SIZE,
        definition="Turns of the body by 45° or more.",
        of="take",
        counted="turns",
    ),
    ParameterEntry(
        "turn_angle_deg",
        label="Angle of a turn",
        group=WALKING,
        digits=0,
        scale=(0, 360),
        comparison=SIZE,
        definition="Angle by which the body turned, mean of the turns.",
        of="take",
        counted="turns",
    ),
    ParameterEntry(
        "turn_duration_s",
        label="Time for a turn",
        group=WALKING,
        digits=1,
        scale=(0, 6),
        comparison=DURATION,
        definition="Time that a turn takes.",
        of="take",
        counted="turns",
    ),
    ParameterEntry(
        "turn_peak_velocity_dps",
        label="Fastest in a turn",
        group=WALKING,
        digits=0,
        scale=(0, 300),
        comparison=SIZE,
        definition="Fastest rate of turning in a turn.",
        of="take",
        counted="turns",
    ),
)
