"""User-visible names of variables, parameters, reasons and differences."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from sagittal.core.message import Message
from sagittal.core.parameters.catalogue import Comparison, find_entry
from sagittal.core.parameters.kinematic import is_level
from sagittal.core.parameters.symmetry import Symmetry
from sagittal.core.user_text import UserText

Plane = Literal["sagittal", "frontal", "transverse"]


@dataclass(frozen=True)
class Variable:
    """A joint angle over the gait cycle.

    Parameters
    ----------
    label : title of its chart. y_range, ticks : degrees, the same in all sessions.
    up, down : labels of the two ends of the axis.
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


@dataclass(frozen=True)
class Term:
    """Label of a parameter or score in tables.

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


def parameter_term(name: str) -> Term:
    """Term of a parameter or rule; KeyError for an unknown name."""
    e = find_entry(name)
    if e is None:
        raise KeyError(name)
    return Term(e.label, e.printed_unit, e.group, e.digits, e.scale, e.comparison)


ZERO_WORDS: Final[Mapping[str, str]] = {
    "anatomical": "anatomical",
    "standing": "relative to standing",
    "walking": "from the mean in walking",
    "stride_mean": "from its mean over the stride",
}
"""Zero of an angle → addition to its title."""


def title_of(name: str, label: str, zero: str = "standing") -> str:
    """Title of a parameter; angles include their zero, so that titles are unique."""
    return f"{label}, {ZERO_WORDS[zero]}" if is_level(name) else label


REASONS: Final[Mapping[str, str]] = {
    "no_strides": "not measured: no included stride on this side",
    "too_few_strides": "not measured: fewer than 4 included strides on this side",
    "no_angles": "not measured: the leg has no joint angles",
    "no_whole_day": "not measured: no day was worn for ten hours",
    "no_repetitions": "not measured: no squats detected",
    "no_counted_repetitions": "not measured: no squat could be included",
    "no_rise": "not measured: no rise from a chair detected",
    "no_sit_down": "not measured: no sitting down after the rise detected",
    "turn_missing": "not measured: two half turns between rising and sitting down not detected",
    "too_few_rises": "not measured: fewer than five consecutive rises",
    "standing_too_short": "not measured: no 20 s of quiet standing",
    "noise_dominated": "not reported: dominated by sensor noise",
    "walk_too_short": "not measured: the walk is too short for this test",
    "test_not_found": "not measured: test not detected",
    "in_place": "not measured: the foot landed where it started",
    "no_terminal_contact": "not measured: no foot-off detected",
    "no_turns": "not measured: no turn in this trial",
    "no_bouts": "not measured: no sufficiently long walk",
    "no_walking": "not measured: the trunk hardly moved",
    "non_periodic": "not measured: trunk movement has no step rhythm",
    "few_steps": "not measured: too few consecutive steps",
    "opposite_foot_missing": "not measured: requires sensors on both feet",
    "no_double_support": "not measured: the feet were never on the floor together",
    "foot_late": "not reported: the clock of one foot is late",
    "not_walking": "not reported: the movement is not walking",
    "joint_missing": "not measured: a segment of this joint has no sensor",
    "estimator_bad": "not reported: the sensors contradict each other here",
    "feet_contradict": "not reported: left and right contacts contradict each other",
    "path_bad": "not reported: the foot path does not match its foot-flat periods",
    "fixed_by_model": "not measured: fixed in the leg model",
    "at_bound": "not reported: the knee of the leg model is at its limit",
    "impossible": "not reported: not physiologically plausible",
    "gap": "not measured: the sensor was lost in every stride",
    "packets_lost": "not measured: packets were lost in the swing of every stride",
    "treadmill": "not measured: on a treadmill, speed and stride length require the belt speed",
    "no_foot_track": "not measured: no sensor on this foot",
    "no_foot_flat": "not measured: the foot was never flat on the floor",
    "no_standing": "not measured: no usable quiet standing in this trial",
    "angle_zero_standing": "not measured: angles are relative to standing; enter goniometer angles",
    "no_level": "not measured: only the shape over the stride is known, not its level relative to the "
    "walking direction",
    "variables_missing": "not measured: some of its variables are missing",
    "estimated": "not measured by a sensor on each segment",
    "standing_width_unknown": "not measured: enter the distance between the ankles while standing",
    "feet_not_linked": "not measured: requires sensors on both legs and the pelvis to locate the feet",
    "no_shoe_geometry": "not measured: requires the shape of the shoe",
    "no_swing_minimum": "not measured: the toe's height has no dip in swing",
    "no_foot_sensor": "not measured: no sensor on this foot",
    "no_pelvis_sensor": "not measured: no sensor on the pelvis",
    "no_forward": "not measured: the forward direction is unknown with a trunk sensor alone",
    "no_run": "not measured: never three consecutive included strides",
    "few_strides": "not measured: requires at least 10 included strides",
    "no_mid_stance": "not measured: the heel rises before the other foot leaves the floor",
    "no_terminal_stance": "not measured: the heel stays down until the other foot lands",
    "feet_not_adjacent": "not measured: the swinging foot does not pass the other",
    "tibia_not_vertical": "not measured: the shank does not pass the vertical in swing",
    "not_reached": "not measured: this analysis has no joint angles",
}
"""Reason code → text instead of a number."""

EXCLUDED: Final[Mapping[str, str]] = {
    "incomplete": "incomplete",
    "turn": "in a turn",
    "in_place": "on the spot",
    "near_turn": "next to a turn",
    "first": "first of a walk",
    "last": "last of a walk",
    "gap": "sensor lost",
    "implausible_time": "implausible duration",
    "outlier": "atypical",
    "non_periodic": "not periodic",
}
"""Exclusion code of a stride → words."""

GROUPS: Final[Mapping[str, str]] = {
    "adult_21_84": "adults 21–84 years",
    "adult_21_54": "adults 21–54 years",
    "adult_55_84": "adults 55–84 years",
}
"""Reference group → its description."""

NO_NORM: Final[Mapping[str, str]] = {
    "no_norm_for_age": "No norm for this age: the reference people are adults.",
    "no_speed_matched_norm": "No norm at this speed: it is outside the range of the reference people.",
    "age_unknown": "No norm for timing: enter the year of birth.",
    "sex_unknown": "No norm for timing: enter the sex.",
}
"""Why there is no reference."""


def reason_words(code: str | None) -> str:
    """Text for a missing number; an unknown code is returned unchanged."""
    return "not measured" if code is None else REASONS.get(code, f"not measured: {code.replace('_', ' ')}")


def place_words(sensor: str) -> str:
    """Name of a segment, "right shank"; a device id unchanged."""
    name, _, suffix = sensor.rpartition("_")
    side = {"l": "left", "r": "right"}.get(suffix)
    return sensor if side is None or not name else f"{side} {name}"


def speak_places(text: str) -> str:
    """Replace segment codes in a sentence by their names.

    >>> speak_places("Units of shank_r and foot_l; columns shank_l_qw stay.")
    'Units of right shank and left foot; columns shank_l_qw stay.'
    """
    if isinstance(text, Message):
        return text.map_words(speak_places)
    if isinstance(text, Message):
        return text.map_words(speak_places)
    return _SIDED.sub(lambda found: place_words(found[0]), text)


_SIDED: Final = re.compile(r"\b(?:thigh|shank|foot)_[lr]\b")

NOT_COUNTED: Final[Mapping[str, str]] = {
    "incomplete": "cut by the start or end of the trial",
    "signal_lost": "a sensor was silent",
    "foot_moved": "the foot moved",
    "foot_lifted": "the foot was off the floor",
}
"""Why a squat is excluded → words."""


def explain_repetition(code: str) -> str:
    """Reason for excluding a squat."""
    return NOT_COUNTED.get(code, code)


def explain_exclusion(code: str) -> str:
    """Reason for excluding a stride; a therapist's own reason is returned as typed."""
    if code.startswith("manual:"):
        return UserText(code.removeprefix("manual:").strip())
    return EXCLUDED.get(code, code)


def format_number(value: float, digits: int = 0) -> str:
    """A number with a true minus sign and without a negative zero."""
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0 else text.replace("-", "−")


def format_uncertainty(value: float, digits: int) -> str:
    """Uncertainty of a number with this many decimals, using up to two more if it would round to 0.

    >>> format_uncertainty(2.4, 0), format_uncertainty(0.08, 0)
    ('± 2', '± 0.1')
    """
    decimals = next((d for d in range(digits, digits + 3) if round(value, d)), digits)
    return f"± {format_number(value, decimals)}"


def symmetry_words(s: Symmetry) -> str:
    """Symmetry indices of two sides with their reference; "" for angles, for which the difference
    suffices.
    """
    if s.ratio is None or s.index_pct is None or s.angle_pct is None:
        return "a side is too near zero for a ratio" if s.reason == "near_zero" else ""
    first, second = s.reference.split("/")
    return Message(
        "{first} / {second} {ratio}, symmetry index {index_pct} % (positive: {first2} larger), "
        "symmetry angle {angle_pct} % (negative: {first3} larger)",
        first=first,
        second=second,
        ratio=format_number(s.ratio, 2),
        index_pct=_signed(s.index_pct),
        first2=first,
        angle_pct=_signed(s.angle_pct),
        first3=first,
    )


def _signed(value: float, digits: int = 1) -> str:
    """A number that always has a sign, unless it rounds to 0."""
    text = format_number(value, digits)
    return f"+{text}" if value > 0 and float(f"{value:.{digits}f}") else text


NO_DIFFERENCE: Final = "no difference"


def round_difference(left: float, right: float, term: Term) -> float:
    """Difference of two displayed values, consistent with their rounding.

    Angles are compared in whole degrees, since tenths are far below the repeatability between visits.
    """
    digits = _difference_digits(term)
    if term.unit != "°":
        left, right = round(left, digits), round(right, digits)
    return round(abs(left - right), digits)


def _difference_digits(term: Term) -> int:
    return 0 if term.unit == "°" else term.digits


def difference_words(left: float, right: float, term: Term) -> str:
    """Left against right in words: "left longer by 0.04 s", "no difference" where printed values agree."""
    digits = _difference_digits(term)
    difference = round_difference(left, right, term)
    if difference == 0:
        return NO_DIFFERENCE
    unit = {"%": " points", "°": "°"}.get(term.unit, f"\u202f{term.unit}")
    return f"left {term.comparison[0 if left > right else 1]} by {format_number(difference, digits)}{unit}"


JUDGED: Final[Mapping[str | None, str]] = {
    "warn": "The pose estimator considers part of its result unreliable.",
    "bad": "The sensors contradict each other, so the estimated poses are unreliable.",
}
"""Verdict of the estimator → reason for the quality level."""

PATH_JUDGED: Final = (
    "The path of a foot does not match its foot-flat periods, so its distances are unreliable."
)
"""Likewise if only the path of a foot is bad."""
