"""Catalogue entry of a parameter, and texts shared by several of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Final, Literal

from sagittal.core.parameters.catalogue.errors import MeasurementErrors

Need = Literal[
    "foot_sensor", "foot_path", "foot_off", "other_foot", "linked_feet", "standing_width", "shoe",
    "hip", "knee", "ankle", "pelvis_sensor", "trunk_sensor", "forward", "squat", "daily_life",
]  # fmt: skip

NEEDS: Final[Mapping[Need, str]] = {
    "foot_sensor": "a sensor on the foot",
    "foot_path": "the path of the foot",
    "foot_off": "foot-off",
    "other_foot": "contacts of both feet",
    "linked_feet": "sensors on both legs and the pelvis",
    "standing_width": "distance between the ankles while standing",
    "shoe": "the shape of the shoe",
    "hip": "sensors on pelvis and thigh",
    "knee": "sensors on thigh and shank",
    "ankle": "sensors on shank and foot",
    "pelvis_sensor": "a sensor on the pelvis",
    "trunk_sensor": "a sensor on the pelvis or the chest",
    "forward": "the direction of walking",
    "daily_life": "a recording of daily life with a sensor on the chest or the lower back",
    "squat": "a squat trial with sensors on shank, thigh and pelvis",
}
"""What a parameter cannot be measured without, beside contacts, in words."""

Scope = Literal["stride", "take"]
"""A parameter of every stride, by side, or of the whole take only."""

Comparison = tuple[str, str]
"""What a value is when it is the larger one, and when it is the smaller one."""

DURATION: Final[Comparison] = ("longer", "shorter")
SIZE: Final[Comparison] = ("larger", "smaller")
FLEXION: Final[Comparison] = ("more flexed", "straighter")
DORSIFLEXION: Final[Comparison] = ("more dorsiflexed", "more plantarflexed")
TOES: Final[Comparison] = ("toes higher", "toes lower")
WIDTH: Final[Comparison] = ("wider", "narrower")
HEIGHT: Final[Comparison] = ("higher", "lower")
TOE_OUT: Final[Comparison] = ("turned out more", "turned out less")
TURN: Final[Comparison] = ("more to the left", "more to the right")

DISTANCES: Final = "Speed and distance"
TIMING: Final = "Timing"
PHASES: Final = "Phases of the stride"
PARTS: Final = "Parts of stance and swing"
HIP_AND_KNEE: Final = "Hip and knee angles"
ANKLE_AND_FOOT: Final = "Ankle and foot angles"
WALKING: Final = "Walking and turning"
TRUNK: Final = "Regularity of the trunk"
SUPPORT: Final = "Support in seconds"
SQUAT: Final = "Squats"
TUG: Final = "Timed up and go"
CHAIR: Final = "Five times sit to stand"
WALK_TESTS: Final = "Walk tests"
SWAY: Final = "Sway in quiet standing"
FUNCTIONAL: Final = (TUG, CHAIR, WALK_TESTS, SWAY)
"""Groups of the functional tests (core/functional_tests)."""
DAILY: Final = "Daily life"
LIMITS: Final = "Values outside limits"
"""Group of the figures that are only compared with a limit: no table has rows of them."""

UNITS: Final[Mapping[str, tuple[str, str]]] = {
    "mps": ("m/s", "m/s"),
    "spm": ("steps/min", "steps/min"),
    "deg": ("deg", "°"),
    "pct": ("%", "%"),
    "dps": ("deg/s", "°/s"),
    "min": ("min", "min"),
    "mps2": ("m/s2", "m/s²"),
    "m2ps4": ("m2/s4", "m²/s⁴"),
    "m2ps5": ("m2/s5", "m²/s⁵"),
    "hz": ("Hz", "Hz"),
    "m": ("m", "m"),
    "s": ("s", "s"),
}
"""Last part of a parameter's name → its unit in files, and as printed."""


@dataclass(frozen=True)
class CurveFigure:
    """A statistic of one cycle curve between two percentages of the stride, inclusive."""

    variable: str
    statistic: Literal["at", "max", "min", "range"]
    start_pct: int = 0
    end_pct: int = 100


@dataclass(frozen=True)
class NormKey:
    """Location of a parameter's reference (core/norms/values.py).

    Parameters
    ----------
    table : "angles" of the adults of the cycle curves, "walkway" by age and sex. row : its name there.
    differs : difference in measurement that makes values incomparable: "ankles".
    """

    table: Literal["angles", "walkway"]
    row: str
    differs: Literal["ankles"] | None = None


@dataclass(frozen=True)
class ParameterEntry:
    """Definition and presentation of one parameter, wherever it is displayed.

    Parameters
    ----------
    name : field term ending with its unit. label : as printed. group : heading in tables.
    digits : decimals as printed. scale : fixed ends of its range bar, in its unit.
    comparison : wording for the larger and the smaller of two values. definition : one or two plain
        sentences.
    needs : requirements other than contacts.
    of : "stride" = for every stride, by side; "take" = only for the whole recording, squats by side.
        counted : unit of counting for its mean.
    curve : how it is read from a cycle curve; such a parameter needs no further code.
    trainable : can be trained with feedback. everyday : patient-friendly label.
    shared : equal on both sides in steady walking, so neither side is trained alone.
    better : which of two sides serves as the training target for the other (our choice); None = neither.
    is_length : can be displayed to the patient as a distance on the floor.
    plausible : minimum and maximum of physiological values; others are detection errors.
    norm : its reference, None without one. change : its limits of change (core/change/limits.py), None
        without a source. errors : its measurement uncertainty; None = unknown, no uncertainty is reported.
    """

    name: str
    label: str
    group: str
    digits: int
    scale: tuple[float, float]
    comparison: Comparison
    definition: str
    needs: tuple[Need, ...] = ()
    of: Scope = "stride"
    counted: Literal[
        "strides", "steps", "feet", "bouts", "turns", "repetitions", "tests", "days"
    ] = "strides"  # fmt: skip
    curve: CurveFigure | None = None
    trainable: bool = False
    everyday: str = ""
    shared: bool = False
    better: Literal["higher", "lower"] | None = None
    is_length: bool = False
    plausible: tuple[float, float] = (-inf, inf)
    norm: NormKey | None = None
    change: str | None = None
    errors: MeasurementErrors | None = None

    @property
    def unit(self) -> str:
        """Unit in files, "" for a ratio or a count."""
        return unit_of(self.name)

    @property
    def target_range(self) -> tuple[float, float]:
        """Minimum and maximum that may be entered as a target.

        The plausible range; if not declared, the range bar extended by its length to either side (our
        choice), below 0 only if the bar includes negative values.
        """
        low, high = self.scale
        least, most = 2 * low - high, 2 * high - low
        return max(self.plausible[0], least if low < 0 else 0.0), min(self.plausible[1], most)

    @property
    def printed_unit(self) -> str:
        """Unit as printed."""
        return UNITS.get(_ending(self.name), ("", ""))[1]


def unit_of(name: str) -> str:
    """Unit from the ending of a name, "" for a ratio."""
    return UNITS.get(_ending(name), ("", ""))[0]


def _ending(name: str) -> str:
    return name.rpartition("_")[2]
