"""Selection of the reference for a person: by age, sex and dimensionless speed, or the reason for having
none.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from sagittal.core.norms.at_speed import (
    angle_values_at_speed,
    bands_at_speed,
    is_matched,
    walkway_values_at_speed,
)
from sagittal.core.norms.kinematics import NormBand, adult_kinematics
from sagittal.core.norms.place import NormPlacement, place_difference, place_value
from sagittal.core.norms.speed import SPEED_SD, WalkingSpeed, walking_speed
from sagittal.core.norms.values import (
    NormValue,
    Pace,
    Sex,
    angle_values,
    comfortable_speed,
    is_angle,
    pace_of,
    predict_at_speed,
    temporal_values,
    withdraw_shares,
)


@dataclass(frozen=True, eq=False)
class Norms:
    """All references for a person.

    Parameters
    ----------
    speed : None = not measured; the reference is then all adults at comfortable speed.
    pace : class of the walkway norms for this speed.
    values : parameter → reference, each with n, group, source and whether it is comparable. For adults below
        comfortable speed: of healthy adults instructed to walk equally slowly
        (`sagittal.core.norms.at_speed.ASKED`).
    expected : step length and cadence expected at exactly this speed.
    bands : variable → band over the cycle, each with its zero; for this speed, as `values`.
    comfortable, comfortable_bands : of people at their comfortable speed, if the above are for the person's
        speed; empty if the above already are.
    reason : why angles have no reference: "no_norm_for_age", "no_speed_matched_norm" (slower or faster than
        the reference people).
    timing_reason : why times and distances have no reference: these, or "age_unknown", "sex_unknown". Gait
        speed itself is compared with the comfortable speed of healthy people, regardless of the person's
        speed.
    """

    speed: WalkingSpeed | None
    pace: Pace | None
    values: Mapping[str, NormValue] = field(default_factory=dict)
    expected: Mapping[str, NormValue] = field(default_factory=dict)
    bands: Mapping[str, NormBand] = field(default_factory=dict)
    comfortable: Mapping[str, NormValue] = field(default_factory=dict)
    comfortable_bands: Mapping[str, NormBand] = field(default_factory=dict)
    reason: str | None = None
    timing_reason: str | None = None

    def place(self, name: str, value: float | None, uncertainty: float | None = None) -> NormPlacement:
        """Placement of a parameter value, known ± `uncertainty`, among the reference people."""
        reason = self.reason if is_angle(name) else self.timing_reason
        return place_value(value, self.values.get(name), reason or "no_norm", uncertainty)

    def place_difference(self, name: str, left: float | None, right: float | None) -> NormPlacement:
        """Placement of left minus right among healthy differences."""
        return place_difference(left, right, self.values.get(name))


def look_up_norms(
    age: float | None,
    sex: Sex | None = None,
    speed_mps: float | None = None,
    height_m: float | None = None,
    anatomical: Collection[str] = (),
    *,
    treadmill: bool = False,
    contacts_s: float | None = 0.0,
) -> Norms:
    """Look up the references for a person.

    Parameters
    ----------
    age : years; None = all adults, but no reference for times and distances. sex : None = no reference for
        these.
    speed_mps : walking speed. height_m : to make it dimensionless.
    anatomical : variables with a known anatomical level on both sides
        (`sagittal.core.parameters.anatomical_zero`); for all others only ranges are compared.
    treadmill : steps on a belt are faster and shorter than overground at the same speed; below comfortable
        speed they are compared with treadmill walking.
    contacts_s : uncertainty of the contacts (`GaitEvents.contact_uncertainty_s`), 0 = exact, None = unknown;
        phases as a percentage of the stride are compared only if it is small.
    """
    norms = _look_up(age, sex, speed_mps, height_m, anatomical, treadmill=treadmill)
    return replace(norms, values=withdraw_shares(norms.values, contacts_s))


def _look_up(
    age: float | None,
    sex: Sex | None,
    speed_mps: float | None,
    height_m: float | None,
    anatomical: Collection[str],
    *,
    treadmill: bool,
) -> Norms:
    speed = None if speed_mps is None else walking_speed(speed_mps, height_m)
    usual = _at_comfortable_speed(age, sex, speed, anatomical)
    if speed is None or usual.reason == "no_norm_for_age":
        return usual
    expected = predict_at_speed(speed.speed_mps, age, speed.leg_m)
    if not is_matched(speed.norm_speed):
        return usual if usual.reason else replace(usual, expected=expected)
    v, leg = speed.norm_speed, speed.norm_leg_m
    matched: dict[str, NormValue] = dict(angle_values_at_speed(age, v, anatomical))
    if not treadmill:
        walkway = walkway_values_at_speed(v, leg)
        matched |= walkway
        expected = {name: walkway[name] for name in _EXPECTED}
    matched |= expected
    bands = bands_at_speed(age, v)
    at_ease = _at_comfortable_speed(age, sex, None, anatomical)
    return replace(
        usual,
        values={**usual.values, **matched},
        expected=expected,
        bands={**usual.bands, **bands},
        comfortable={name: x for name, x in at_ease.values.items() if name in matched},
        comfortable_bands={name: x for name, x in at_ease.bands.items() if name in bands},
        reason=None,
        timing_reason=usual.timing_reason if treadmill else None,
    )


_EXPECTED: Final = ("step_length_m", "cadence_spm")


def _is_too_fast(speed: WalkingSpeed | None, timing: Mapping[str, NormValue]) -> bool:
    """Whether a person walks faster than the people of a walkway table without pace classes."""
    liked = timing.get("gait_speed_mps")
    if speed is None or liked is None or not liked.comparable:
        return False
    return speed.speed_mps > liked.mean + SPEED_SD * liked.sd


def _at_comfortable_speed(
    age: float | None, sex: Sex | None, speed: WalkingSpeed | None, anatomical: Collection[str]
) -> Norms:
    """The reference of people at their comfortable speed, for speeds within its range."""
    slow = speed is not None and speed.is_slow
    fast = speed is not None and speed.is_fast
    bands = adult_kinematics(age)
    reason = bands.reason or ("no_speed_matched_norm" if slow or fast else None)
    values = {} if reason else dict(angle_values(age, anatomical).values)
    # a class of speeds is of people of this age and sex, whose legs are in it already
    pace = pace_of(age, sex, None if speed is None else speed.speed_mps)
    timing = temporal_values(age, sex, pace or "normal")
    missing = timing.reason or (
        "no_speed_matched_norm"
        if pace is None or (slow and not bands.reason) or _is_too_fast(speed, timing.values)
        else None
    )
    if missing is None:
        values |= timing.values
    if (liked := comfortable_speed(age, sex)) is not None:
        # how fast somebody likes to walk is not a matter of how fast they walk
        values["gait_speed_mps"] = liked
    return Norms(
        speed,
        None if missing else pace,
        values,
        bands={} if reason else bands.bands,
        reason=reason,
        timing_reason=missing,
    )
