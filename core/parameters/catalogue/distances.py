"""Speed and distances: between the flats of the feet (core/parameters/spatial.py)."""

from __future__ import annotations

from typing import Final

from core.parameters.catalogue import errors
from core.parameters.catalogue.entry import DISTANCES, DURATION, HEIGHT, SIZE, WIDTH, NormKey, ParameterEntry

ENTRIES: Final = (
    ParameterEntry(
        "gait_speed_mps",
        label="Gait speed",
        group=DISTANCES,
        digits=2,
        scale=(0, 2),
        comparison=SIZE,
        definition="Stride length over the time between the same two foot-flats, mean of both feet.",
        needs=("foot_path",),
        trainable=True,
        everyday="pace",
        norm=NormKey("walkway", "speed_m_s"),
        change="speed",
        errors=errors.SPEED,
    ),
    ParameterEntry(
        "stride_length_m",
        label="Stride length",
        group=DISTANCES,
        digits=2,
        scale=(0.2, 1.8),
        comparison=DURATION,
        definition="Distance on the floor between two successive foot-flats of one foot.",
        needs=("foot_path",),
        trainable=True,
        everyday="stride",
        is_length=True,
        norm=NormKey("walkway", "stride_length_m"),
        errors=errors.STRIDE_LENGTH,
    ),
    ParameterEntry(
        "step_length_m",
        label="Step length",
        group=DISTANCES,
        digits=2,
        scale=(0, 1),
        comparison=DURATION,
        definition=(
            "Distance along the direction of progression from the other foot's flat to this foot's; it "
            "belongs to the foot that lands."
        ),
        needs=("foot_path", "linked_feet"),
        trainable=True,
        everyday="step",
        is_length=True,
        norm=NormKey("walkway", "step_length_m"),
        change="step_length",
        errors=errors.STEP_LENGTH,
    ),
    ParameterEntry(
        "step_width_m",
        label="Step width",
        group=DISTANCES,
        digits=2,
        scale=(-0.05, 0.35),
        comparison=WIDTH,
        definition=(
            "Distance across the direction of progression between the flats of the two feet, ankle to ankle; "
            "negative when the feet cross."
        ),
        needs=("foot_path", "linked_feet", "standing_width"),
        trainable=True,
        everyday="space between the feet",
        norm=NormKey("walkway", "stride_width_m", differs="ankles"),
        errors=errors.STEP_WIDTH,
    ),
    ParameterEntry(
        "circumduction_m",
        label="Circumduction",
        group=DISTANCES,
        digits=3,
        scale=(0, 0.2),
        comparison=SIZE,
        definition="Largest distance of the foot outward from the straight line between its two flats.",
        needs=("foot_path",),
        trainable=True,
        errors=errors.CIRCUMDUCTION,
    ),
    ParameterEntry(
        "max_heel_clearance_m",
        label="Heel clearance, most",
        group=DISTANCES,
        digits=2,
        scale=(0, 0.5),
        comparison=HEIGHT,
        definition="Highest point of the heel above the floor in swing.",
        needs=("foot_path", "shoe"),
        trainable=True,
        everyday="heel height",
        errors=errors.HEEL_CLEARANCE,
    ),
    ParameterEntry(
        "min_toe_clearance_m",
        label="Toe clearance, least in swing",
        group=DISTANCES,
        digits=3,
        scale=(-0.02, 0.12),
        comparison=HEIGHT,
        definition="Lowest point of the tip of the shoe above the floor in the middle of swing.",
        needs=("foot_path", "shoe", "foot_off"),
        trainable=True,
        everyday="toe height",
        errors=errors.TOE_CLEARANCE,
    ),
    ParameterEntry(
        "total_distance_m",
        label="Distance walked",
        group=DISTANCES,
        digits=1,
        scale=(0, 100),
        comparison=SIZE,
        definition="Way of the take from rest to rest of a foot, turns and all; mean of the feet.",
        needs=("foot_path",),
        of="take",
        counted="feet",
    ),
)
