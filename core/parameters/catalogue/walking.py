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
        definition="Steps detected with the trunk sensor.",
        of="take",
        counted="steps",
    ),
    ParameterEntry(
        "walking_bout_count",
        label="Walking bouts",
        group=WALKING,
        digits=0,
        scale=(0, 10),
        comparison=SIZE,
        definition="Walking bouts of at least four strides without a break longer than 3 s.",
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
        definition="Total time of these bouts.",
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
        definition="Body turns of 45° or more.",
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
        definition="Turning angle of the body, mean of all turns.",
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
        definition="Duration of a turn.",
        of="take",
        counted="turns",
    ),
    ParameterEntry(
        "turn_peak_velocity_dps",
        label="Peak turning speed",
        group=WALKING,
        digits=0,
        scale=(0, 300),
        comparison=SIZE,
        definition="Peak turning rate in a turn.",
        of="take",
        counted="turns",
    ),
)
