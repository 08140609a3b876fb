"""Curves relative to the anatomical zero: goniometer angles in standing, added back
(docs/science/joint-angles.md, "Anatomical zero").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sagittal.core.frames import SIDES, SUFFIX, Floats, Side
from sagittal.core.parameters.catalogue import list_curve_figures
from sagittal.core.parameters.kinematic import is_level, summarise_angles
from sagittal.core.parameters.result import CycleCurves, Parameter
from sagittal.core.parameters.uncertainty import state_uncertainty
from sagittal.core.subject.standing_angles import JOINTS, PELVIS, check_standing


def anatomical_curves(curves: CycleCurves, standing_deg: Mapping[str, float]) -> CycleCurves:
    """Curves relative to the anatomical zero, only for variables with an entered standing angle.

    Parameters
    ----------
    curves : relative to standing.
    standing_deg : goniometer angles in standing, `sagittal.core.subject.standing_angles.NAMES`.

    Raises
    ------
    ParameterError as `check_standing`.
    """
    check_standing(standing_deg)
    relative_curves: dict[str, dict[Side, Floats]] = {}
    bounds: dict[str, dict[Side, float]] = {}
    for variable, sides in curves.curves.items():
        for side, rows in sides.items():
            if standing_name(variable, side) not in standing_deg:
                continue
            offset = float(np.radians(standing_offset_deg(variable, side, standing_deg)))
            relative_curves.setdefault(variable, {})[side] = rows + offset
            if (bound := curves.bounds.get(variable, {}).get(side)) is not None:
                bounds.setdefault(variable, {})[side] = bound + offset
    return replace(curves, curves=relative_curves, bounds=bounds)


def standing_name(variable: str, side: Side) -> str:
    """Name of the standing angle for the curves of a variable and side."""
    return variable if variable in PELVIS else f"{variable}_{SUFFIX[side]}"


def standing_offset_deg(variable: str, side: Side, standing_deg: Mapping[str, float]) -> float:
    """Offset that converts cycle curves from standing to anatomical, degrees; KeyError if not measured."""
    # cycle curves of the left have the left side up
    sign = -1.0 if variable == "pelvis_obliquity" and side == "left" else 1.0
    return sign * standing_deg[standing_name(variable, side)]


def anatomical_parameters(curves: CycleCurves, standing_deg: Mapping[str, float]) -> tuple[Parameter, ...]:
    """Angle parameters relative to the anatomical zero, for sides and variables with an entered standing
    angle.

    Names are those of the parameters relative to standing; ranges, which are independent of the zero, are not
    repeated.
    """
    level, figures = anatomical_curves(curves, standing_deg), list_curve_figures()
    parameters = tuple(
        p
        for p in summarise_angles(level)
        if p.side is not None
        and is_level(p.name)
        and p.side in level.curves.get(figures[p.name].variable, {})
    )
    return state_uncertainty(parameters, goniometer=True)


def anatomical_variables(standing_deg: Mapping[str, float]) -> tuple[str, ...]:
    """Variables with a known level on both sides, for the lookup of norms."""
    joints = (v for v in JOINTS if all(f"{v}_{SUFFIX[s]}" in standing_deg for s in SIDES))
    return (*(v for v in PELVIS if v in standing_deg), *joints)
