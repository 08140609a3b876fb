"""One person → the reference that fits: by age, sex and dimensionless speed, or none and why."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from core.norms.kinematics import NormBand, adult_kinematics
from core.norms.place import NormPlacement, place_difference, place_value
from core.norms.speed import WalkingSpeed, walking_speed
from core.norms.values import (
    NormValue,
    Pace,
    Sex,
    angle_values,
    comfortable_speed,
    is_angle,
    pace_of,
    predict_at_speed,
    temporal_values,
)


@dataclass(frozen=True, eq=False)
class Norms:
    """Everything a person is compared with.

    Parameters
    ----------
    speed : None = not measured; then all adults at comfortable speed are the reference.
    pace : class of the walkway norms that this speed falls into.
    values : parameter → reference, each with n, group, source and whether it is comparable.
    expected : step length and cadence expected at this very speed (treadmill, 0.5 to 1.5 m/s).
    bands : variable → band over the cycle, each with its zero.
    reason : why no angle is compared: "no_norm_for_age", "no_speed_matched_norm".
    timing_reason : why no time or distance is compared: these, or "age_unknown", "sex_unknown". Gait speed
        itself is held against the speed healthy people like, however slow the person.
    """

    speed: WalkingSpeed | None
    pace: Pace | None
    values: Mapping[str, NormValue] = field(default_factory=dict)
    expected: Mapping[str, NormValue] = field(default_factory=dict)
    bands: Mapping[str, NormBand] = field(default_factory=dict)
    reason: str | None = None
    timing_reason: str | None = None

    def place(self, name: str, value: float | None) -> NormPlacement:
        """Where a value of a parameter stands."""
        reason = self.reason if is_angle(name) else self.timing_reason
        return place_value(value, self.values.get(name), reason or "no_norm")

    def place_difference(self, name: str, left: float | None, right: float | None) -> NormPlacement:
        """Where left minus right stands among healthy differences."""
        return place_difference(left, right, self.values.get(name))


def look_up_norms(
    age: float | None,
    sex: Sex | None = None,
    speed_mps: float | None = None,
    height_m: float | None = None,
    anatomical: Collection[str] = (),
) -> Norms:
    """Look up the reference of a person.

    Parameters
    ----------
    age : years; None = all adults, and nobody for times and distances. sex : None = nobody for these.
    speed_mps : walking speed. height_m : makes it dimensionless.
    anatomical : variables whose anatomical level is known on both sides
        (`core.parameters.anatomical_zero`); figures of the others compare in range only.
    """
    speed = None if speed_mps is None else walking_speed(speed_mps, height_m)
    at = None if speed is None else speed.equivalent_mps
    bands = adult_kinematics(age, at)
    values = {} if bands.reason else dict(angle_values(age, anatomical).values)
    # a class of speeds is of people of this age and sex, whose legs are in it already
    pace = pace_of(age, sex, speed_mps)
    timing = temporal_values(age, sex, pace or "normal")
    slow = bands.reason == "no_speed_matched_norm" or pace is None
    missing = timing.reason or ("no_speed_matched_norm" if slow else None)
    expected: Mapping[str, NormValue] = {}
    if missing is None:
        values |= timing.values
    if (usual := comfortable_speed(age, sex)) is not None:
        # how fast somebody likes to walk is not a matter of how fast they walk
        values["gait_speed_mps"] = usual
    if speed is not None and not bands.reason:
        expected = predict_at_speed(speed.speed_mps, age, speed.leg_m)
    return Norms(
        speed,
        None if missing else pace,
        values,
        expected,
        bands.bands,
        reason=bands.reason,
        timing_reason=missing,
    )
