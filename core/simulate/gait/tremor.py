"""Trembling legs: the sensors of both legs shake on their segments, the two legs in turn.

Like the shock of contact it is motion of the sensor, so acceleration, rate and pose belong together, and the
segment itself does not notice: where the feet stand stays the exact truth. Size and rhythm are of the kind
that is reported for freezing (3 to 8 Hz) and for Parkinsonian tremor (4 to 6 Hz), not measured ones
(docs/science/simulation.md, "Impaired walks").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import Final

import numpy as np

from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Floats, Segment, Side
from sagittal.core.simulate.shapes import smoothstep

EDGE_S: Final = 0.3
"""Trembling grows and fades over so long."""
SHARE: Final[Mapping[str, float]] = {"foot": -1.0, "shank": 0.6, "thigh": -0.4}
"""Turn about the segment's z axis for one unit of trembling: the heel rises, the knee gives."""
LEVER_M: Final = 0.06
"""The sensor rises by this for a turn of one radian: the foot pitches about its ball."""


@dataclass(frozen=True)
class Tremor:
    """Trembling from `start_s` to `end_s`; `size_rad` is half of what the foot turns through."""

    start_s: float
    end_s: float
    hz: float
    size_rad: float


def tremble_sensor(t: Floats, segment: Segment, tremors: tuple[Tremor, ...]) -> tuple[Floats, Floats]:
    """Displacement (n, 3) in m in the world and turn (n,) in rad about the segment's z axis of its sensor.

    The pelvis does not tremble.
    """
    shift, turn = np.zeros((len(t), 3)), np.zeros(len(t))
    kind, side = segment.split("_")[0], _side_of(segment)
    if side is None:
        return shift, turn
    for tremor in tremors:
        size = smoothstep((t - tremor.start_s) / EDGE_S) * smoothstep((tremor.end_s - t) / EDGE_S)
        late = 0.0 if side == "right" else pi
        wave = tremor.size_rad * size * np.sin(2.0 * pi * tremor.hz * (t - tremor.start_s) + late)
        turn += SHARE[kind] * wave
        shift[:, 2] += LEVER_M * abs(SHARE[kind]) * wave
    return shift, turn


def _side_of(segment: Segment) -> Side | None:
    return next((s for s in SIDES if segment in (THIGH[s], SHANK[s], FOOT[s])), None)
