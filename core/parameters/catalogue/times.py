"""Times between the contacts (core/parameters/temporal.py)."""

from __future__ import annotations

from math import inf
from typing import Final

from sagittal.core.parameters.catalogue import errors
from sagittal.core.parameters.catalogue.entry import DURATION, SIZE, TIMING, NormKey, ParameterEntry

ENTRIES: Final = (
    ParameterEntry(
        "cadence_spm",
        label="Cadence",
        group=TIMING,
        digits=0,
        scale=(40, 150),
        comparison=SIZE,
        definition="60 over the mean step time of both feet.",
        needs=("other_foot",),
        of="take",
        counted="steps",
        plausible=(0, 240),
        norm=NormKey("walkway", "cadence_steps_min"),
        errors=errors.CADENCE,
    ),
    ParameterEntry(
        "pci_pct",
        label="Phase coordination index",
        group=TIMING,
        digits=1,
        scale=(0, 15),
        comparison=SIZE,
        definition=(
            "Phase coordination index (Plotnik 2007), how far and how variably the step times depart from "
            "half of the stride; 0 is perfectly alternating."
        ),
        needs=("other_foot", "foot_off"),
        of="take",
    ),
    ParameterEntry(
        "stride_time_s",
        label="Stride time",
        group=TIMING,
        digits=2,
        scale=(0.7, 2.1),
        comparison=DURATION,
        definition="From a contact of the foot to its next.",
        trainable=True,
        shared=True,
        everyday="rhythm",
        norm=NormKey("walkway", "stride_time_s"),
        errors=errors.STRIDE,
    ),
    ParameterEntry(
        "step_time_s",
        label="Step time",
        group=TIMING,
        digits=2,
        scale=(0.3, 1.1),
        comparison=DURATION,
        definition="From the other foot's contact to this foot's; it belongs to the foot that lands.",
        needs=("other_foot",),
        trainable=True,
        everyday="step rhythm",
        plausible=(0.2, inf),
        norm=NormKey("walkway", "step_time_s"),
        errors=errors.STEP,
    ),
    ParameterEntry(
        "stance_time_s",
        label="Stance time",
        group=TIMING,
        digits=2,
        scale=(0.4, 1.6),
        comparison=DURATION,
        definition="From contact to foot-off of the same foot.",
        needs=("foot_off",),
        trainable=True,
        everyday="foot on the floor",
        errors=errors.STANCE,
    ),
    ParameterEntry(
        "swing_time_s",
        label="Swing time",
        group=TIMING,
        digits=2,
        scale=(0.2, 0.8),
        comparison=DURATION,
        definition="From foot-off to the next contact of the same foot.",
        needs=("foot_off",),
        trainable=True,
        everyday="foot in the air",
        errors=errors.SWING,
    ),
)
