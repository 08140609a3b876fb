"""Curves from the anatomical zero: what a goniometer read in standing, added back (spec/clinic.md §8.4)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from core.frames import SUFFIX, Floats, Side
from core.parameters.result import CycleCurves
from core.standing import PELVIS, check_standing


def anatomical_curves(curves: CycleCurves, standing_deg: Mapping[str, float]) -> CycleCurves:
    """Curves from the anatomical zero: those whose standing angle was entered, and no others.

    Parameters
    ----------
    curves : from standing. standing_deg : goniometer angles in standing, `core.standing.NAMES`.

    Raises
    ------
    ParameterError as `check_standing`.
    """
    check_standing(standing_deg)
    found: dict[str, dict[Side, Floats]] = {}
    for variable, sides in curves.curves.items():
        for side, rows in sides.items():
            name = variable if variable in PELVIS else f"{variable}_{SUFFIX[side]}"
            if name not in standing_deg:
                continue
            # cycle curves of the left have the left side up
            sign = -1.0 if variable == "pelvis_obliquity" and side == "left" else 1.0
            found.setdefault(variable, {})[side] = rows + sign * float(np.radians(standing_deg[name]))
    return CycleCurves(found, curves.stride_index, curves.used, curves.foot_off_pct)
