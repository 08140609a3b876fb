"""A chair for a walker: position of the pelvis and lean of the trunk in sitting, rising and sitting down
(docs/science/simulation.md, "Timed up and go").

The feet do not move; the legs follow by the same inverse kinematics as in walking.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Final, Literal

import numpy as np

from sagittal.core.frames import Floats
from sagittal.core.simulate.shapes import bump, smoothstep

LEAN: Final = radians(35.0)
"""The trunk leans forward by so much on the way up from a chair, and down to it."""

LIFTING: Final = 0.7
"""Share of the change in which the height changes: its last part going up, its first going down."""

PELVIS_LEAN: Final = radians(30.0)
"""The pelvis leans forward by so much on the way up and down, less than the trunk above it (our choice)."""

SEATED_TILT: Final = radians(-12.0)
"""The pelvis rolls back by so much on a chair (our choice)."""

SEATED_CHEST: Final = radians(5.0)
"""The chest leans forward by so much more on a chair than in standing, as in `chest.POSTURES`."""

DROP, BACK = 0.95, 0.95
"""The hips of a seated person are lower and further back than standing by so many lengths of the thigh."""


@dataclass(frozen=True)
class ChairChange:
    """One rise from the chair or one sitting down."""

    kind: Literal["sit_to_stand", "stand_to_sit"]
    start_s: float
    end_s: float


@dataclass(frozen=True, eq=False)
class SeatMotion:
    """Contribution of the chair to a walker's pelvis and trunk; all (n,).

    Parameters
    ----------
    drop, back : displacement of the hips, in thigh lengths. pelvis_rad, chest_rad : added forward lean.
    """

    drop: Floats
    back: Floats
    pelvis_rad: Floats
    chest_rad: Floats


def sit_and_rise(t: Floats, changes: tuple[ChairChange, ...]) -> SeatMotion:
    """Apply the transitions in chronological order; before a rise the person is seated."""
    begins = 1.0 if changes and changes[0].kind == "sit_to_stand" else 0.0
    low, back, seated, lean = (
        np.full(len(t), begins),
        np.full(len(t), begins),
        np.full(len(t), begins),
        0.0 * t,
    )
    for change in changes:
        u = (t - change.start_s) / (change.end_s - change.start_s)
        lean += bump(u)
        if change.kind == "sit_to_stand":
            low -= smoothstep((u - 1.0 + LIFTING) / LIFTING)
            back -= smoothstep(u)
            seated -= smoothstep(u)
        else:
            low += smoothstep(u / LIFTING)
            back += smoothstep(u)
            seated += smoothstep(u)
    return SeatMotion(
        drop=DROP * low,
        back=BACK * back,
        pelvis_rad=PELVIS_LEAN * lean + SEATED_TILT * seated,
        chest_rad=LEAN * lean + SEATED_CHEST * seated,
    )
