"""How variables, parameters, reasons and differences are called in front of people."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from core.parameters.kinematic import is_level
from core.parameters.symmetry import Symmetry

Plane = Literal["sagittal", "frontal", "transverse"]


@dataclass(frozen=True)
class Variable:
    """A joint angle over the gait cycle.

    Parameters
    ----------
    label : title of its chart. y_range, ticks : degrees, the same in all sessions.
    up, down : words at the two ends of the axis.
    """

    name: str
    label: str
    plane: Plane
    y_range: tuple[float, float]
    ticks: tuple[float, ...]
    up: str
    down: str


def _variable(
    name: str, label: str, plane: Plane, limit: tuple[int, int], step: int, up: str, down: str
) -> Variable:
    low, high = limit
    ticks = tuple(float(t) for t in range(-180, 181, step) if low <= t <= high)
    return Variable(name, label, plane, (float(low), float(high)), ticks, up, down)


VARIABLES: Final[tuple[Variable, ...]] = (
    _variable("pelvis_tilt", "Pelvic tilt", "sagittal", (-25, 25), 10, "Anterior", "Posterior"),
    _variable("pelvis_obliquity", "Pelvic obliquity", "frontal", (-25, 25), 10, "Side up", "Side down"),
    _variable("pelvis_rotation", "Pelvic rotation", "transverse", (-25, 25), 10, "Forward", "Backward"),
    _variable("hip_flexion", "Hip flexion", "sagittal", (-40, 60), 20, "Flexion", "Extension"),
    _variable("hip_adduction", "Hip adduction", "frontal", (-25, 25), 10, "Adduction", "Abduction"),
    _variable("hip_rotation", "Hip rotation", "transverse", (-30, 30), 15, "Internal", "External"),
    _variable("knee_flexion", "Knee flexion", "sagittal", (-15, 75), 20, "Flexion", "Extension"),
    _variable("knee_adduction", "Knee adduction", "frontal", (-25, 25), 10, "Adduction", "Abduction"),
    _variable("knee_rotation", "Knee rotation", "transverse", (-30, 30), 15, "Internal", "External"),
    _variable(
        "ankle_dorsiflexion",
        "Ankle dorsiflexion",
        "sagittal",
        (-40, 30),
        20,
        "Dorsiflexion",
        "Plantarflexion",
    ),
    _variable("ankle_inversion", "Ankle inversion", "frontal", (-30, 30), 15, "Inversion", "Eversion"),
    _variable("ankle_rotation", "Ankle rotation", "transverse", (-30, 30), 15, "Internal", "External"),
)
"""In reading order: pelvis, hip, knee, ankle; sagittal, frontal, transverse.

Ranges are those customary in gait reports, wider where an angle from standing goes below an anatomical one.
"""


Comparison = tuple[str, str]
"""What the left side is when its value is larger, and when it is smaller."""

_TIME: Final[Comparison] = ("longer", "shorter")
_SIZE: Final[Comparison] = ("larger", "smaller")
_FLEX: Final[Comparison] = ("more flexed", "straighter")
_ANKLE: Final[Comparison] = ("more dorsiflexed", "more plantarflexed")
_TOES: Final[Comparison] = ("toes higher", "toes lower")


@dataclass(frozen=True)
class Term:
    """A parameter in the table.

    Parameters
    ----------
    label, unit : as printed. digits : decimals of the value.
    scale : fixed ends of its range bar. comparison : words for left against right.
    """

    label: str
    unit: str
    group: str
    digits: int
    scale: tuple[float, float]
    comparison: Comparison


_WAY, _TIMING, _PHASES = "Speed and distance", "Timing", "Phases of the stride"
_SUPPORT = "Support in seconds"
_HIP_KNEE, _ANKLE_FOOT = "Hip and knee angles", "Ankle and foot angles"
_PARTS, _TRUNK = "Parts of stance and swing", "Regularity of the trunk"
_WALKING = "Walking and turning"

_WIDTH: Final[Comparison] = ("wider", "narrower")
_HEIGHT: Final[Comparison] = ("higher", "lower")
_OUT: Final[Comparison] = ("turned out more", "turned out less")
_TURN: Final[Comparison] = ("more to the left", "more to the right")

TERMS: Final[Mapping[str, Term]] = {
    "gait_speed_mps": Term("Gait speed", "m/s", _WAY, 2, (0, 2), _SIZE),
    "stride_length_m": Term("Stride length", "m", _WAY, 2, (0.2, 1.8), _TIME),
    "step_length_m": Term("Step length", "m", _WAY, 2, (0, 1), _TIME),
    "step_width_m": Term("Step width", "m", _WAY, 2, (-0.05, 0.35), _WIDTH),
    "circumduction_m": Term("Circumduction", "m", _WAY, 3, (0, 0.2), _SIZE),
    "max_heel_clearance_m": Term("Heel clearance, most", "m", _WAY, 2, (0, 0.5), _HEIGHT),
    "min_toe_clearance_m": Term("Toe clearance, least in swing", "m", _WAY, 3, (-0.02, 0.12), _HEIGHT),
    "total_distance_m": Term("Distance walked", "m", _WAY, 1, (0, 100), _SIZE),
    "cadence_spm": Term("Cadence", "steps/min", _TIMING, 0, (40, 150), _SIZE),
    "pci_pct": Term("Phase coordination index", "%", _TIMING, 1, (0, 15), _SIZE),
    "stride_time_s": Term("Stride time", "s", _TIMING, 2, (0.7, 2.1), _TIME),
    "step_time_s": Term("Step time", "s", _TIMING, 2, (0.3, 1.1), _TIME),
    "stance_time_s": Term("Stance time", "s", _TIMING, 2, (0.4, 1.6), _TIME),
    "swing_time_s": Term("Swing time", "s", _TIMING, 2, (0.2, 0.8), _TIME),
    "stance_pct": Term("Stance", "%", _PHASES, 1, (50, 80), _TIME),
    "swing_pct": Term("Swing", "%", _PHASES, 1, (20, 50), _TIME),
    "double_support_pct": Term("Double support", "%", _PHASES, 1, (0, 55), _TIME),
    "initial_double_support_pct": Term("Initial double support", "%", _PHASES, 1, (0, 30), _TIME),
    "terminal_double_support_pct": Term("Terminal double support", "%", _PHASES, 1, (0, 30), _TIME),
    "single_support_pct": Term("Single support", "%", _PHASES, 1, (15, 50), _TIME),
    "loading_pct": Term("Loading, of stance", "%", _PARTS, 1, (0, 40), _TIME),
    "foot_flat_pct": Term("Foot flat, of stance", "%", _PARTS, 1, (20, 90), _TIME),
    "push_pct": Term("Heel-off to foot-off, of stance", "%", _PARTS, 1, (0, 60), _TIME),
    "mid_stance_pct": Term("Mid stance", "%", _PARTS, 1, (0, 40), _TIME),
    "terminal_stance_pct": Term("Terminal stance", "%", _PARTS, 1, (0, 30), _TIME),
    "initial_swing_pct": Term("Initial swing", "%", _PARTS, 1, (0, 30), _TIME),
    "mid_swing_pct": Term("Mid swing", "%", _PARTS, 1, (0, 25), _TIME),
    "terminal_swing_pct": Term("Terminal swing", "%", _PARTS, 1, (0, 30), _TIME),
    "hip_flexion_ic_deg": Term("Hip flexion at contact", "°", _HIP_KNEE, 1, (-10, 60), _FLEX),
    "hip_flexion_min_deg": Term("Hip flexion, least", "°", _HIP_KNEE, 1, (-40, 30), _FLEX),
    "hip_flexion_rom_deg": Term("Hip flexion range", "°", _HIP_KNEE, 1, (0, 70), _SIZE),
    "knee_flexion_ic_deg": Term("Knee flexion at contact", "°", _HIP_KNEE, 1, (-20, 40), _FLEX),
    "knee_flexion_max_loading_deg": Term("Knee flexion, loading peak", "°", _HIP_KNEE, 1, (-10, 50), _FLEX),
    "knee_flexion_min_stance_deg": Term("Knee flexion, least in stance", "°", _HIP_KNEE, 1, (-20, 40), _FLEX),
    "knee_flexion_max_swing_deg": Term("Knee flexion, swing peak", "°", _HIP_KNEE, 1, (10, 90), _FLEX),
    "knee_flexion_rom_deg": Term("Knee flexion range", "°", _HIP_KNEE, 1, (0, 90), _SIZE),
    "ankle_dorsiflexion_ic_deg": Term("Dorsiflexion at contact", "°", _ANKLE_FOOT, 1, (-30, 30), _ANKLE),
    "ankle_dorsiflexion_max_stance_deg": Term(
        "Dorsiflexion, stance peak", "°", _ANKLE_FOOT, 1, (-20, 40), _ANKLE
    ),
    "ankle_dorsiflexion_min_deg": Term("Dorsiflexion, least", "°", _ANKLE_FOOT, 1, (-50, 20), _ANKLE),
    "ankle_dorsiflexion_max_swing_deg": Term(
        "Dorsiflexion, swing peak", "°", _ANKLE_FOOT, 1, (-30, 30), _ANKLE
    ),
    "ankle_dorsiflexion_rom_deg": Term("Dorsiflexion range", "°", _ANKLE_FOOT, 1, (0, 60), _SIZE),
    "foot_pitch_ic_deg": Term("Foot pitch at contact", "°", _ANKLE_FOOT, 1, (-30, 45), _TOES),
    "foot_pitch_tc_deg": Term("Foot pitch at foot-off", "°", _ANKLE_FOOT, 1, (-90, 10), _TOES),
    "toe_out_deg": Term("Toe-out, from standing", "°", _ANKLE_FOOT, 1, (-25, 25), _OUT),
    "turning_angle_deg": Term("Turn of the foot in a stride", "°", _ANKLE_FOOT, 1, (-15, 15), _TURN),
    "step_count": Term("Steps", "", _WALKING, 0, (0, 1000), _SIZE),
    "walking_bout_count": Term("Walks without a long break", "", _WALKING, 0, (0, 10), _SIZE),
    "walking_duration_min": Term("Time walked", "min", _WALKING, 1, (0, 10), _TIME),
    "turn_count": Term("Turns", "", _WALKING, 0, (0, 20), _SIZE),
    "turn_angle_deg": Term("Angle of a turn", "°", _WALKING, 0, (0, 360), _SIZE),
    "turn_duration_s": Term("Time for a turn", "s", _WALKING, 1, (0, 6), _TIME),
    "turn_peak_velocity_dps": Term("Fastest in a turn", "°/s", _WALKING, 0, (0, 300), _SIZE),
    "harmonic_ratio_v": Term("Harmonic ratio, vertical", "", _TRUNK, 2, (0, 6), _SIZE),
    "harmonic_ratio_ap": Term("Harmonic ratio, forward", "", _TRUNK, 2, (0, 6), _SIZE),
    "harmonic_ratio_ml": Term("Harmonic ratio, sideways", "", _TRUNK, 2, (0, 6), _SIZE),
    "step_regularity_v": Term("Regularity of steps, vertical", "", _TRUNK, 2, (0, 1), _SIZE),
    "step_regularity_ap": Term("Regularity of steps, forward", "", _TRUNK, 2, (0, 1), _SIZE),
    "stride_regularity_v": Term("Regularity of strides, vertical", "", _TRUNK, 2, (0, 1), _SIZE),
    "stride_regularity_ap": Term("Regularity of strides, forward", "", _TRUNK, 2, (0, 1), _SIZE),
    "stride_sparc": Term("Smoothness of a stride (SPARC)", "", _TRUNK, 2, (-6, -1), _SIZE),
    "double_support_s": Term("Double support time", "s", _SUPPORT, 2, (0, 0.8), _TIME),
    "initial_double_support_s": Term("Initial double support time", "s", _SUPPORT, 2, (0, 0.4), _TIME),
    "terminal_double_support_s": Term("Terminal double support time", "s", _SUPPORT, 2, (0, 0.4), _TIME),
    "single_support_s": Term("Single support time", "s", _SUPPORT, 2, (0.2, 0.8), _TIME),
}
"""Parameter name → how the table shows it, in the order of the table."""

ZERO_WORDS: Final[Mapping[str, str]] = {
    "anatomical": "anatomical",
    "standing": "from standing",
    "stride_mean": "from its mean over the stride",
}
"""Zero of an angle → what is added to its title."""


def title_of(name: str, label: str, zero: str = "standing") -> str:
    """Title of a parameter: a level says what it is measured from, so that no two figures share a name."""
    return f"{label}, {ZERO_WORDS[zero]}" if is_level(name) else label


REASONS: Final[Mapping[str, str]] = {
    "no_strides": "not measured: no stride of this side counts",
    "too_few_strides": "not measured: fewer than 4 strides of this side count",
    "in_place": "not measured: the foot came down where it was",
    "no_terminal_contact": "not measured: no foot-off was found",
    "no_turns": "not measured: no turn in this take",
    "no_bouts": "not measured: nobody walked for long enough",
    "no_walking": "not measured: the trunk hardly moved",
    "non_periodic": "not measured: the trunk's movement has no rhythm of steps",
    "few_steps": "not measured: too few steps in a row",
    "opposite_foot_missing": "not measured: needs sensors on both feet",
    "no_double_support": "not measured: the feet were never on the floor together",
    "joint_missing": "not measured: a segment of this joint carries no sensor",
    "estimator_bad": "withheld: the sensors contradict each other here",
    "at_bound": "withheld: the leg model's knee rests on its limit",
    "impossible": "withheld: nobody can walk like this",
    "gap": "not measured: the sensor was lost in every stride",
    "treadmill": "not measured: on a treadmill the belt's speed is needed, and gives speed and stride length",
    "no_foot_track": "not measured: no sensor on this foot",
    "no_foot_flat": "not measured: the foot never rested on the floor",
    "angle_zero_standing": "not measured: angles start from standing; enter goniometer angles",
    "no_level": "not measured: has a shape over the stride, no level against the walking direction",
    "variables_missing": "not measured: some of its variables are missing",
    "estimated": "not measured by two sensors",
    "standing_width_unknown": "not measured: enter how far apart the ankles are while standing",
    "feet_not_linked": "not measured: needs sensors on both legs and the pelvis to place the feet",
    "no_shoe_geometry": "not measured: needs the shape of the shoe",
    "no_swing_minimum": "not measured: the toe's height has no dip in swing",
    "no_foot_sensor": "not measured: no sensor on this foot",
    "no_pelvis_sensor": "not measured: no sensor on the pelvis",
    "no_forward": "not measured: a trunk sensor alone does not know which way is forward",
    "no_run": "not measured: never three strides in a row that count",
    "few_strides": "not measured: needs at least 10 strides that count",
    "no_mid_stance": "not measured: the heel rises before the other foot leaves the floor",
    "no_terminal_stance": "not measured: the heel stays down until the other foot lands",
    "feet_not_adjacent": "not measured: the swinging foot does not pass the other",
    "tibia_not_vertical": "not measured: the shank does not pass the vertical in swing",
    "not_reached": "not measured: this analysis has no joint angles",
}
"""Reason code → words in place of a number."""

EXCLUDED: Final[Mapping[str, str]] = {
    "incomplete": "incomplete",
    "turn": "in a turn",
    "in_place": "on the spot",
    "near_turn": "next to a turn",
    "first": "first of a walk",
    "last": "last of a walk",
    "gap": "sensor lost",
    "implausible_time": "implausible duration",
    "outlier": "unlike the others",
    "non_periodic": "not periodic",
}
"""Code of a stride left out → words."""

NO_NORM: Final[Mapping[str, str]] = {
    "no_norm_for_age": "No norm for this age: the reference people are adults.",
    "no_speed_matched_norm": "No speed-matched norm: no adult reference exists below 0.8 m/s.",
    "age_unknown": "No norm for timing: enter the year of birth.",
    "sex_unknown": "No norm for timing: enter the sex.",
}
"""Why there is no reference at all."""


def reason_words(code: str | None) -> str:
    """Words for a missing number; a code without words shows itself."""
    return "not measured" if code is None else REASONS.get(code, f"not measured: {code.replace('_', ' ')}")


def place_words(sensor: str) -> str:
    """A segment in words, "right shank"; a device id as it is."""
    name, _, suffix = sensor.rpartition("_")
    side = {"l": "left", "r": "right"}.get(suffix)
    return sensor if side is None or not name else f"{side} {name}"


def excluded_words(code: str) -> str:
    """Words for a stride left out; a therapist's own reason is shown as typed."""
    return code.removeprefix("manual:").strip() if code.startswith("manual:") else EXCLUDED.get(code, code)


def number(value: float, digits: int = 0) -> str:
    """A number with a real minus sign and without a negative zero."""
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0 else text.replace("-", "−")


def symmetry_words(s: Symmetry) -> str:
    """The indices of two sides with what they put first; "" for angles, whose difference says it all."""
    if s.ratio is None or s.index_pct is None or s.angle_pct is None:
        return "a side is too near zero for a ratio" if s.reason == "near_zero" else ""
    first, other = s.reference.split("/")
    return (
        f"{first} / {other} {number(s.ratio, 2)}, symmetry index {_signed(s.index_pct)} % (positive: {first} "
        f"larger), symmetry angle {_signed(s.angle_pct)} % (negative: {first} larger)"
    )


def _signed(value: float, digits: int = 1) -> str:
    """A number that always carries its sign, unless it rounds to 0."""
    text = number(value, digits)
    return f"+{text}" if value > 0 and float(f"{value:.{digits}f}") else text


NO_DIFFERENCE: Final = "no difference"


def difference_words(left: float, right: float, term: Term) -> str:
    """Left against right in words: "left longer by 0.04 s", "no difference" where the printed values agree.

    Angles are compared in whole degrees: tenths are far below what repeats between visits.
    """
    digits = 0 if term.unit == "°" else term.digits
    if term.unit != "°":
        left, right = round(left, digits), round(right, digits)
    shown = round(abs(left - right), digits)
    if shown == 0:
        return NO_DIFFERENCE
    unit = {"%": " points", "°": "°"}.get(term.unit, f"\u202f{term.unit}")
    return f"left {term.comparison[0 if left > right else 1]} by {number(shown, digits)}{unit}"
