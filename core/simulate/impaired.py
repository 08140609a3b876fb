"""People who do not walk like the textbook: hardly lifted, dragged and trembling feet, aids and orthoses
(docs/science/simulation.md, "Impaired walks").

As with the virtual patients: one body, plausible in scale, no clinical data, the left side affected. Truth is
exact; they show whether strides and contacts are found where hardly anything of a normal step is left. A cane
and a walking frame are how they change steps and pauses; neither carries weight here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import radians as deg
from types import MappingProxyType
from typing import Final

from sagittal.core.simulate.patients import ANTALGIC, PARKINSON, PATIENTS, SEVERE_SHUFFLE, UNEVEN
from sagittal.core.simulate.script import Script, SingleSteps, Stand, Straight, Tremble
from sagittal.core.simulate.walker import SideGait, Walker

SHUFFLER: Final = replace(
    SEVERE_SHUFFLE,
    sides={s: replace(g, clearance_m=0.010) for s, g in SEVERE_SHUFFLE.sides.items()},
)
"""Feet hardly turn and are lifted by a centimetre."""

TREMBLING: Final = replace(PARKINSON, tremor_rad=deg(0.64), tremor_hz=5.0)
"""Short quick steps with a tremor of ±20 °/s that does not end."""

STEP_TO: Final = Walker(
    variability=UNEVEN,
    width_m=0.14,
    impact=0.6,
    sides={
        "left": SideGait(
            length_factor=1.85,
            double_support=0.17,
            contact_pitch_rad=0.0,
            push=0.2,
            knee_swing_rad=deg(30.0),
            clearance_m=0.010,
        ),
        "right": SideGait(
            length_factor=0.15,
            double_support=0.20,
            contact_pitch_rad=deg(3.0),
            push=0.4,
            knee_swing_rad=deg(40.0),
            clearance_m=0.010,
        ),
    },
)
"""The left foot steps, the right one comes beside it."""

DRAGGED_FOOT: Final = Walker(
    variability=UNEVEN,
    width_m=0.15,
    impact=0.6,
    sides={
        "left": SideGait(
            length_factor=1.10,
            time_factor=1.15,
            double_support=0.18,
            contact_pitch_rad=deg(-3.0),
            push=0.12,
            knee_swing_rad=deg(15.0),
            hip_factor=0.7,
            ankle_swing_rad=deg(-15.0),
            circumduction_rad=deg(4.0),
            hike_rad=deg(3.0),
            clearance_m=-0.006,
            toe_out_rad=deg(20.0),
        ),
        "right": SideGait(
            length_factor=0.90, time_factor=0.85, double_support=0.15, knee_swing_rad=deg(66.0)
        ),
    },
)
"""The left foot is drawn along the floor behind the other one."""

CIRCUMDUCTION: Final = Walker(
    variability=UNEVEN,
    width_m=0.16,
    sides={
        "left": SideGait(
            length_factor=1.05,
            time_factor=1.10,
            double_support=0.15,
            contact_pitch_rad=deg(-2.0),
            push=0.35,
            knee_swing_rad=deg(15.0),
            circumduction_rad=deg(10.0),
            hike_rad=deg(6.0),
            ankle_swing_rad=deg(-8.0),
            clearance_m=0.010,
            toe_out_rad=deg(16.0),
        ),
        "right": SideGait(length_factor=0.95, time_factor=0.90, double_support=0.13),
    },
)
"""The left leg swings out to the side, its knee hardly bent."""

WITH_CANE: Final = replace(ANTALGIC, variability=UNEVEN, width_m=0.13, impact=0.5)
"""Slow, the painful left leg loaded for a short time; the cane in the right hand lands with the left foot."""

WITH_FRAME: Final = Walker(
    variability=UNEVEN,
    width_m=0.14,
    impact=0.4,
    tilt_rad=deg(6.0),
    standing_knee_rad=deg(15.0),
    sides={
        s: SideGait(
            double_support=0.16,
            contact_pitch_rad=deg(2.0),
            push=0.35,
            knee_stance_rad=deg(8.0),
            knee_swing_rad=deg(40.0),
            clearance_m=0.010,
        )
        for s in ("left", "right")
    },
)
"""Bent over a frame, which is put forward before every third step."""

LOCKED_KNEE: Final = Walker(
    variability=UNEVEN,
    width_m=0.15,
    sides={
        "left": SideGait(
            length_factor=1.05,
            time_factor=1.08,
            double_support=0.14,
            contact_pitch_rad=deg(2.0),
            push=0.15,
            knee_wave=0.0,
            knee_swing_rad=deg(3.5),
            circumduction_rad=deg(8.0),
            hike_rad=deg(9.0),
            trailing_factor=0.3,
            clearance_m=0.010,
        ),
        "right": SideGait(length_factor=0.95, time_factor=0.92, double_support=0.12),
    },
)
"""The left knee in an orthosis that does not bend."""


def _bouts(length_m: float, step_m: float, step_s: float) -> Script:
    """Two bouts with a stop, as the other virtual people walk."""
    bout = Straight(length_m, step_m, step_s)
    return (Stand(6.0), bout, Stand(2.0), bout, Stand(4.0))


def _with_frame(times: int = 12, step_m: float = 0.25, step_s: float = 0.75, lift_s: float = 0.8) -> Script:
    """Two steps up to the frame, a third beside them, and the frame goes on."""
    steps, lift = SingleSteps(((step_m, 0.0, step_s), (step_m, 0.0, step_s))), Stand(lift_s)
    return (Stand(6.0), *((steps, lift) * times)[:-1], Stand(4.0))


def _freezing(step_m: float = 0.22, step_s: float = 0.45) -> Script:
    """Walks of a few steps that end in trembling on the spot."""
    start, on = Straight(3.0, step_m, step_s), Straight(2.0, step_m, step_s)
    freeze = Tremble(4.0, hz=6.0, size_rad=deg(3.0))
    return (Stand(6.0), start, freeze, on, freeze, on, Stand(2.0), start, Stand(4.0))


_PARKINSON: Final = PATIENTS["parkinson"]

IMPAIRED: Final[Mapping[str, tuple[str, Script, Walker]]] = MappingProxyType(
    {
        "shuffler": ("Shuffling with feet lifted by a centimetre", _bouts(6.0, 0.15, 0.45), SHUFFLER),
        "freezer": ("Freezing with trembling legs", _freezing(), PARKINSON),
        "trembling": (
            "Short quick steps with a tremor",
            _bouts(9.0, _PARKINSON.step_m, _PARKINSON.step_s),
            TREMBLING,
        ),
        "step_to": ("One foot steps, the other comes beside it", _bouts(6.0, 0.22, 0.85), STEP_TO),
        "dragged_foot": ("Left foot dragged", _bouts(9.0, 0.32, 0.80), DRAGGED_FOOT),
        "circumduction": ("Left leg swung out", _bouts(9.0, 0.40, 0.75), CIRCUMDUCTION),
        "cane": ("With a cane", _bouts(9.0, 0.34, 0.80), WITH_CANE),
        "frame": ("With a walking frame", _with_frame(), WITH_FRAME),
        "locked_knee": ("Left knee locked by an orthosis", _bouts(9.0, 0.45, 0.70), LOCKED_KNEE),
    }
)
"""Name → title, script for a walker of the reference height, and who walks it."""
