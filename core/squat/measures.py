"""Measures of single-leg squats: depth, times, dynamic knee valgus, curves.

Dynamic knee valgus combines adduction and internal rotation of the thigh (Kianifar et al. 2019,
doi:10.1177/2055668318813455; docs/science/squat.md, "Measures").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.angles import JointAngles
from sagittal.core.body.chain.leg import LegMotion
from sagittal.core.frames import FOOT, SUFFIX, Floats, Side
from sagittal.core.parameters.catalogue import list_names, unit_of
from sagittal.core.parameters.catalogue.entry import SQUAT
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.variability import summarise_values
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.squat.curves import CURVES, INWARD, KNEE, cut_curves
from sagittal.core.squat.repetitions import FOOT_LIFTED, Repetition, RepetitionParams, find_repetitions

MEASURES: Final = list_names(SQUAT, "take")
"""Names in the order of the table; what each is: docs/science/squat.md, "Measures"."""


@dataclass(frozen=True, eq=False)
class SquatSide:
    """The squats of one leg.

    Parameters
    ----------
    repetitions : every deep knee bend. values : measure → (counted,) in its unit, for valid repetitions.
    curves : `CURVES` and `VALGUS` → (counted, 101) rad over the repetition, 0 start, 100 end.
    parameters : mean and spread of every measure; a reason without repetitions.
    """

    side: Side
    repetitions: tuple[Repetition, ...]
    values: Mapping[str, Floats]
    curves: Mapping[str, Floats]
    parameters: tuple[Parameter, ...]


def measure_squats(
    angles: JointAngles,
    leg: LegMotion,
    side: Side,
    recording: UniformRecording | None = None,
    params: RepetitionParams | None = None,
) -> SquatSide:
    """Detect and measure the squats of one leg; `sagittal.core.parameters.symmetry` compares two legs.

    Parameters
    ----------
    angles : of `leg`, relative to standing. recording : its foot sensor shows whether the foot stayed on the
    floor.

    Returns
    -------
    SquatSide; `parameters` have no value and the reason "no_angles" without knee angles, "no_repetitions"
    without squats, "no_counted_repetitions" without valid ones.
    """
    suffix = SUFFIX[side]
    own = {name: angles.angles.get(f"{name}_{suffix}") for name in CURVES}
    available = {name: values for name, values in own.items() if values is not None}
    if len(available) < len(CURVES):
        return SquatSide(side, (), {}, {}, _summarise({}, side, "no_angles"))
    t_s = angles.t_s
    foot_rate = _foot_rate(recording, side)
    repetitions = find_repetitions(available[KNEE], t_s, side, foot_rate, params, leg.stands)
    valid = [r for r in repetitions if r.excluded is None]
    if not valid:
        squatted = any(r.excluded != FOOT_LIFTED for r in repetitions)
        reason = "no_counted_repetitions" if squatted else "no_repetitions"
        return SquatSide(side, repetitions, {}, {}, _summarise({}, side, reason))
    curves = cut_curves(angles, side, [(r.start_s, r.end_s) for r in valid])
    values = _measure(valid, available, leg)
    return SquatSide(side, repetitions, values, curves, _summarise(values, side, None))


def _measure(valid: list[Repetition], angles: Mapping[str, Floats], leg: LegMotion) -> dict[str, Floats]:
    """Measure → values (counted,)."""
    height = _hip_height(leg)
    rows: list[tuple[float, ...]] = []
    for r in valid:
        part, deepest = slice(r.first, r.last + 1), r.bottom - r.first
        adduction, rotation = (angles[name][part] - angles[name][r.first] for name in INWARD)
        valgus = adduction + rotation
        rows.append(
            (
                np.degrees(angles[KNEE][r.bottom]),
                float(height[r.first] - height[part].min()),
                np.degrees(valgus.max()),
                np.degrees(valgus[deepest]),
                np.degrees(adduction[deepest]),
                np.degrees(rotation[deepest]),
                r.end_s - r.start_s,
                r.descent_s,
                r.ascent_s,
            )
        )
    return dict(zip(MEASURES, np.array(rows).T, strict=True))


def _hip_height(leg: LegMotion) -> Floats:
    """Height (n,) of the hip centre above the ankle, m; NaN before the chain filter starts."""
    height = np.full(len(leg.orientations.t_s), np.nan)
    shank, thigh, _ = leg.chain.links(leg.motion.angles)
    knee, hip = leg.chain.offsets[leg.chain.first[1]], leg.chain.offsets[leg.chain.first[2]]
    height[leg.first :] = shank[:, 2] @ knee + thigh[:, 2] @ hip
    return height


def _foot_rate(recording: UniformRecording | None, side: Side) -> Floats | None:
    """|ω| (n,) of the foot sensor with its median subtracted as bias; None without one."""
    sensor = None if recording is None else recording.sensors.get(FOOT[side])
    if sensor is None or not sensor.valid.any():
        return None
    return np.asarray(np.linalg.norm(sensor.gyr - np.median(sensor.gyr[sensor.valid], axis=0), axis=1))


def _summarise(values: Mapping[str, Floats], side: Side, reason: str | None) -> tuple[Parameter, ...]:
    return tuple(
        summarise_values(name, side, values.get(name, np.empty(0)).tolist(), unit_of(name), reason)
        for name in MEASURES
    )
