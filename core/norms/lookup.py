"""One person → the reference that fits: by age, sex and dimensionless speed, or none and why."""

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
    """Everything a person is compared with.

    Parameters
    ----------
    speed : None = not measured; then all adults at comfortable speed are the reference.
    pace : class of the walkway norms that this speed falls into.
    values : parameter → reference, each with n, group, source and whether it is comparable. Adults below
        comfortable speed: of healthy adults asked to walk as slowly (`sagittal.core.norms.at_speed.ASKED`).
    expected : step length and cadence expected at this very speed.
    bands : variable → band over the cycle, each with its zero; at this speed as `values`.
    comfortable, comfortable_bands : of people at their own comfortable speed, where the above are at this
        one; empty where the above are of these people already.
    reason : why no angle is compared: "no_norm_for_age", "no_speed_matched_norm" (slower or faster than the
        reference people).
    timing_reason : why no time or distance is compared: these, or "age_unknown", "sex_unknown". Gait speed
        itself is held against the speed healthy people like, however slow the person.
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
        """Where a value of a parameter, known ± `uncertainty`, stands."""
        reason = self.reason if is_angle(name) else self.timing_reason
        return place_value(value, self.values.get(name), reason or "no_norm", uncertainty)

    def place_difference(self, name: str, left: float | None, right: float | None) -> NormPlacement:
        """Where left minus right stands among healthy differences."""
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
    """Look up the reference of a person.

    Parameters
    ----------
    age : years; None = all adults, and nobody for times and distances. sex : None = nobody for these.
    speed_mps : walking speed. height_m : makes it dimensionless.
    anatomical : variables whose anatomical level is known on both sides
        (`sagittal.core.parameters.anatomical_zero`); figures of the others compare in range only.
    treadmill : steps on a belt are quicker and shorter than on the floor at the same speed; below comfortable
        speed they are held against people on a belt.
    contacts_s : what the contacts are known to (`GaitEvents.contact_uncertainty_s`), 0 = exact, None = not
        known; shares of the stride compare only where it is small.
    """
    found = _look_up(age, sex, speed_mps, height_m, anatomical, treadmill=treadmill)
    return replace(found, values=withdraw_shares(found.values, contacts_s))


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
    """Whether a person walks faster than the people of a walkway table that has no classes of pace."""
    liked = timing.get("gait_speed_mps")
    if speed is None or liked is None or not liked.comparable:
        return False
    return speed.speed_mps > liked.mean + SPEED_SD * liked.sd


def _at_comfortable_speed(
    age: float | None, sex: Sex | None, speed: WalkingSpeed | None, anatomical: Collection[str]
) -> Norms:
    """The reference of people at their comfortable speed, for those whose speed is within its range."""
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
