"""Body lengths as measured with a tape (docs/science/body-model.md, "Lengths").

Missing lengths are estimated from the others and from body height (`sagittal.core.body.model.BodyModel`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Final

from sagittal.core.errors import ParameterError
from sagittal.core.message import Message

LIMITS: Final[Mapping[str, tuple[float, float]]] = {
    "leg_m": (0.3, 1.3),
    "thigh_m": (0.1, 0.7),
    "shank_m": (0.1, 0.7),
    "ankle_height_m": (0.02, 0.15),
    "foot_m": (0.08, 0.4),
    "pelvis_width_m": (0.08, 0.45),
    "pelvis_depth_m": (0.05, 0.35),
}
"""What a tape can read on a child or an adult, m."""


@dataclass(frozen=True)
class BodyMeasures:
    """Tape-measured lengths in m, None = not measured; left and right are assumed equal.

    Parameters
    ----------
    leg_m : anterior superior iliac spine to inner ankle, standing. thigh_m : greater trochanter to the outer
        knee joint line. shank_m : outer knee joint line to outer ankle. ankle_height_m : outer ankle to the
        sole. foot_m : heel to longest toe. pelvis_width_m : between the anterior superior iliac spines.
    pelvis_depth_m : from their midpoint to that of the posterior ones.

    Raises
    ------
    ParameterError `length_implausible`.
    """

    leg_m: float | None = None
    thigh_m: float | None = None
    shank_m: float | None = None
    ankle_height_m: float | None = None
    foot_m: float | None = None
    pelvis_width_m: float | None = None
    pelvis_depth_m: float | None = None

    def __post_init__(self) -> None:
        for name, (low, high) in LIMITS.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise ParameterError(
                    "length_implausible",
                    Message(
                        "{name} {value:g} is outside {low:g} to {high:g} m; give lengths of the body in "
                        "metres.",
                        name=name,
                        value=value,
                        low=low,
                        high=high,
                    ),
                )

    def complete_from(self, other: BodyMeasures) -> BodyMeasures:
        """These measures, with missing ones taken from `other`."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return BodyMeasures(**{k: getattr(other, k) if v is None else v for k, v in values.items()})

    def to_json(self) -> dict[str, float]:
        """The measured lengths, with the keys of a manifest's `subject.measures`."""
        return {name: value for name, value in asdict(self).items() if value is not None}


def locate_hips_across(pelvis_width_m: float, pelvis_depth_m: float | None = None) -> float:
    """Distance in m between the hip centres, from pelvis dimensions.

    References
    ----------
    Harrington et al. 2007, table 4, given there in mm: from width and depth, or from the width alone;
    doi:10.1016/j.jbiomech.2006.02.003.
    """
    if pelvis_depth_m is None:
        return 2.0 * (0.33 * pelvis_width_m + 0.0073)
    return 2.0 * (0.28 * pelvis_depth_m + 0.16 * pelvis_width_m + 0.0079)
