"""Reference curves of healthy adults over the gait cycle (docs/science/norms-and-scores.md).

The reference angles are anatomical, ours are relative to the person's own standing. A band may be drawn with
a curve only if both have the same zero, so every band includes its zero; curves of a person with goniometer
angles in standing have that of the reference (`sagittal.core.parameters.anatomical_zero`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Final, Literal

import numpy as np

from sagittal.core.frames import Floats
from sagittal.core.norms.tables import LEVEL, WBDS, WBDS_N, read_rows, wbds_group

Zero = Literal["anatomical", "standing", "walking", "stride_mean"]
"""What a curve is measured from: anatomy, the person's own standing, its mean over straight walking where
nobody stood, its own mean over each stride."""

_PLANE = "Low confidence outside the sagittal plane."
_HEADING = "Low confidence: transverse angles depend on sensor headings."
_JUDGEMENT: Final[Mapping[str, tuple[Literal["normal", "low"], str]]] = {
    "hip_flexion": ("normal", LEVEL),
    "knee_flexion": ("normal", LEVEL),
    "ankle_dorsiflexion": ("normal", LEVEL),
    "pelvis_tilt": ("low", LEVEL),
    "pelvis_obliquity": ("low", f"{LEVEL} {_PLANE}"),
    "hip_adduction": ("low", f"{LEVEL} {_PLANE}"),
    "hip_rotation": ("low", f"{LEVEL} {_HEADING}"),
    "pelvis_rotation": ("low", _HEADING),
    "foot_progression": ("low", _HEADING),
}
"""Variable → how much to trust its band, what to say beside it."""


@dataclass(frozen=True, eq=False)
class NormBand:
    """Reference of one variable.

    Parameters
    ----------
    variable : as in CycleCurves, e.g. "knee_flexion".
    mean_deg, sd_deg : (101,) mean, and standard deviation of a single side between people.
    n : people. group, source : population and origin; both are printed. zero : zero of its angles; it may be
        drawn only with curves of the same zero. confidence, note : to be printed with it.
    """

    variable: str
    mean_deg: Floats
    sd_deg: Floats
    n: int
    group: str
    source: str
    zero: Zero
    confidence: Literal["normal", "low"]
    note: str


@dataclass(frozen=True, eq=False)
class NormBands:
    """Bands by variable, or none with the reason "no_norm_for_age"."""

    bands: Mapping[str, NormBand] = field(default_factory=dict)
    reason: str | None = None


def adult_kinematics(age: float | None) -> NormBands:
    """Reference bands for a person of this age, walking overground at comfortable speed (1.25 ± 0.16 m/s).

    Those at a person's own speed: `sagittal.core.norms.at_speed`.

    Parameters
    ----------
    age : years; None = all adults.
    """
    group = wbds_group(age)
    return NormBands(reason="no_norm_for_age") if group is None else NormBands(_bands(group))


@cache
def _bands(group: str) -> Mapping[str, NormBand]:
    table = [r for r in read_rows("kinematics_wbds_adult") if r["group"] == group]
    bands = {}
    for variable, (confidence, note) in _JUDGEMENT.items():
        own = sorted((r for r in table if r["variable"] == variable), key=lambda r: float(r["pct_cycle"]))
        mean = np.array([float(r["mean_deg"]) for r in own])
        sd = np.array([float(r["sd_single_side_deg"]) for r in own])
        mean.setflags(write=False)
        sd.setflags(write=False)
        bands[variable] = NormBand(
            variable, mean, sd, WBDS_N[group], group, WBDS, "anatomical", confidence, note
        )
    return bands
