"""Angles from the anatomical zero: what a goniometer read in standing, added back (spec/clinic.md §1, §8.4).

Our calibration makes the person's own standing the zero. Who stands with a knee bent by 10° has every knee
angle 10° too small against any reference; the level exists only where somebody measured the standing angle.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from core.angles import SIGNS
from core.errors import ParameterError
from core.frames import SIDES, SUFFIX, Floats, Side
from core.parameters.result import CycleCurves

PELVIS: Final = ("pelvis_tilt", "pelvis_obliquity")
"""Pelvis angles that standing has a zero for; obliquity is given with the right side up positive."""

NAMES: Final = (
    *PELVIS,
    *(f"{base}_{SUFFIX[side]}" for side in SIDES for joint in SIGNS.values() for base, _, _ in joint),
)
"""Angles that may be entered, named and signed as in `JointAngles`."""

LIMIT_DEG: Final = 60.0
"""Nobody stands quietly with a larger angle; catches radians, minutes and slips of the keyboard."""


def check_standing(standing_deg: Mapping[str, float]) -> None:
    """Refuse names that no angle has and angles nobody stands with.

    Raises
    ------
    ParameterError `unknown_angle`, `standing_angle_implausible`.
    """
    for name, value in standing_deg.items():
        if name not in NAMES:
            raise ParameterError(
                "unknown_angle", f"'{name}' is no angle; expected one of {', '.join(NAMES)}."
            )
        if not abs(value) <= LIMIT_DEG:
            raise ParameterError(
                "standing_angle_implausible",
                f"{name}: {value:g}° in standing is outside ±{LIMIT_DEG:g}°; give what the goniometer read, "
                "in degrees.",
            )


def anatomical_curves(curves: CycleCurves, standing_deg: Mapping[str, float]) -> CycleCurves:
    """Curves from the anatomical zero: those whose standing angle was entered, and no others.

    Parameters
    ----------
    curves : from standing. standing_deg : goniometer angles in standing, `NAMES`.

    Raises
    ------
    ParameterError as `check_standing`.
    """
    check_standing(standing_deg)
    found: dict[str, dict[Side, Floats]] = {}
    for variable, sides in curves.curves.items():
        for side, rows in sides.items():
            standing = standing_deg.get(
                variable if variable in PELVIS else f"{variable}_{SUFFIX[side]}",
            )
            if standing is None:
                continue
            # cycle curves of the left have the left side up
            sign = -1.0 if variable == "pelvis_obliquity" and side == "left" else 1.0
            found.setdefault(variable, {})[side] = rows + sign * float(np.radians(standing))
    return CycleCurves(found, curves.stride_index, curves.used, curves.foot_off_pct)
