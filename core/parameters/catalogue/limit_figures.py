"""Values used only by the rules of core/flags: compared with a limit, without a row in the tables."""

from __future__ import annotations

from typing import Final

from sagittal.core.parameters.catalogue.entry import (
    FLEXION,
    HEIGHT,
    LIMITS,
    SIZE,
    CurveFigure,
    NormKey,
    ParameterEntry,
)

ENTRIES: Final = (
    ParameterEntry(
        "knee_flexion_peak_swing_deg",
        label="Peak knee flexion in mid-swing",
        group=LIMITS,
        digits=1,
        scale=(10, 90),
        comparison=FLEXION,
        definition=(
            "Maximum flexion of the knee in mid-swing (60 to 85 % of the stride), relative to standing."
        ),
        needs=("knee",),
        curve=CurveFigure("knee_flexion", "max", 60, 85),
    ),
    ParameterEntry(
        "pelvis_obliquity_max_swing_deg",
        label="Peak pelvic obliquity in swing",
        group=LIMITS,
        digits=1,
        scale=(-15, 15),
        comparison=HEIGHT,
        definition="Maximum elevation of the pelvis on the swing side, relative to standing.",
        needs=("pelvis_sensor",),
        curve=CurveFigure("pelvis_obliquity", "max", 60, 100),
        norm=NormKey("angles", "pelvis_obliquity_swing_max(60-100%)"),
    ),
    ParameterEntry(
        "swing_to_stance",
        label="Swing time over stance time",
        group=LIMITS,
        digits=2,
        scale=(0, 1),
        comparison=SIZE,
        definition="Mean swing time of a leg divided by its mean stance time.",
        needs=("foot_off",),
    ),
)
