"""Reference curves of healthy adults over the gait cycle (spec/clinic.md §2, §8).

The reference angles are anatomical, ours are zero at the person's own standing: bands of sagittal and frontal
angles show the shape, not the level, and say so; what has no meaning left is marked not comparable. Where the
standing angle is known by goniometer the level is compared too.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Final, Literal

import numpy as np

from core.frames import Floats
from core.norms.speed import SLOW_MPS
from core.norms.tables import LEVEL, WBDS, WBDS_N, rows, wbds_group

_ZERO = (
    "The zero differs: measured from the person's own standing, the reference is anatomical; compare shapes."
)
_PLANE = "Low confidence outside the sagittal plane."
_HEADING = "Low confidence: the transverse plane depends on the sensors' headings."
_JUDGEMENT: Final[Mapping[str, tuple[bool, Literal["normal", "low"], str]]] = {
    "hip_flexion": (True, "normal", _ZERO),
    "knee_flexion": (True, "normal", _ZERO),
    "ankle_dorsiflexion": (True, "normal", _ZERO),
    "pelvis_obliquity": (True, "low", f"{_ZERO} {_PLANE}"),
    "hip_adduction": (True, "low", f"{_ZERO} {_PLANE}"),
    "hip_rotation": (True, "low", f"{_ZERO} {_HEADING}"),
    "pelvis_tilt": (False, "low", "Not comparable: measured from standing, pelvic tilt has lost its level."),
    "pelvis_rotation": (
        True,
        "low",
        "Measured from its own mean over the stride, not against the walking direction; compare shapes.",
    ),
    "foot_progression": (
        False,
        "low",
        "Not comparable in level: measured from its own mean over the stride.",
    ),
}
"""Variable → may the band stand behind our curve, how much to trust it, what to say beside it."""

_WITH_LEVEL: Final[Mapping[str, str]] = {
    "pelvis_obliquity": f"{LEVEL} {_PLANE}",
    "hip_adduction": f"{LEVEL} {_PLANE}",
    "hip_rotation": f"{LEVEL} {_HEADING}",
}
"""What is left to say where the anatomical level is known; of the others `LEVEL` alone."""


@dataclass(frozen=True, eq=False)
class NormBand:
    """Reference of one variable.

    Parameters
    ----------
    variable : as in CycleCurves, e.g. "knee_flexion".
    mean_deg, sd_deg : (101,) mean, and standard deviation of a single side between people.
    n : people. group, source : who and from where; both are printed.
    comparable : the band may stand behind our curve. confidence, note : what to print beside it.
    """

    variable: str
    mean_deg: Floats
    sd_deg: Floats
    n: int
    group: str
    source: str
    comparable: bool
    confidence: Literal["normal", "low"]
    note: str


@dataclass(frozen=True, eq=False)
class NormBands:
    """Bands by variable, or none and the reason: "no_norm_for_age", "no_speed_matched_norm"."""

    bands: Mapping[str, NormBand] = field(default_factory=dict)
    reason: str | None = None


def adult_kinematics(
    age: float | None, speed_mps: float | None = None, anatomical: Collection[str] = ()
) -> NormBands:
    """Reference bands for a person of this age, walking overground at comfortable speed (1.25 ± 0.16 m/s).

    Parameters
    ----------
    age : years; None = all adults.
    speed_mps : walking speed if known, on legs of 0.9 m (`WalkingSpeed.equivalent_mps`); below 0.8 m/s no
        reference applies.
    anatomical : variables whose level is known; their band is comparable in level too.
    """
    group = wbds_group(age)
    if group is None:
        return NormBands(reason="no_norm_for_age")
    if speed_mps is not None and speed_mps < SLOW_MPS:
        return NormBands(reason="no_speed_matched_norm")
    bands = _bands(group)
    return NormBands({name: _level(band) if name in anatomical else band for name, band in bands.items()})


def _level(band: NormBand) -> NormBand:
    return replace(band, comparable=True, note=_WITH_LEVEL.get(band.variable, LEVEL))


@cache
def _bands(group: str) -> Mapping[str, NormBand]:
    table = [r for r in rows("kinematics_wbds_adult") if r["group"] == group]
    bands = {}
    for variable, (comparable, confidence, note) in _JUDGEMENT.items():
        own = sorted((r for r in table if r["variable"] == variable), key=lambda r: float(r["pct_cycle"]))
        mean = np.array([float(r["mean_deg"]) for r in own])
        sd = np.array([float(r["sd_single_side_deg"]) for r in own])
        mean.setflags(write=False)
        sd.setflags(write=False)
        bands[variable] = NormBand(
            variable, mean, sd, WBDS_N[group], group, WBDS, comparable, confidence, note
        )
    return bands
