"""Curves from the anatomical zero: what a goniometer read in standing, added back (spec/clinic.md §8.4)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from core.frames import SIDES, SUFFIX, Floats, Side
from core.parameters.kinematic import FIGURES, kinematic
from core.parameters.result import CycleCurves, Parameter
from core.standing import JOINTS, PELVIS, check_standing


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


def anatomical_parameters(curves: CycleCurves, standing_deg: Mapping[str, float]) -> tuple[Parameter, ...]:
    """Angle parameters from the anatomical zero, of the sides and variables whose standing angle was entered.

    Names are those of the parameters from standing; ranges, which have no zero, are not repeated.
    """
    level = anatomical_curves(curves, standing_deg)
    return tuple(
        p
        for p in kinematic(level)
        if p.side is not None
        and FIGURES[p.name].statistic != "range"
        and p.side in level.curves.get(FIGURES[p.name].variable, {})
    )


def anatomical_variables(standing_deg: Mapping[str, float]) -> tuple[str, ...]:
    """Variables whose level is known on both sides, as the lookup of norms takes them."""
    joints = (v for v in JOINTS if all(f"{v}_{SUFFIX[s]}" in standing_deg for s in SIDES))
    return (*(v for v in PELVIS if v in standing_deg), *joints)
