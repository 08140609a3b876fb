"""Session values → flags: each value compared with its limit, or the reason why it cannot be compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import hypot, sqrt
from typing import Final, Literal

import numpy as np

from sagittal.core.events.result import COMPARED
from sagittal.core.flags.rules import CURVES, RULES, SWING_TO_STANCE, Beyond, Kind, Rule
from sagittal.core.frames import SIDES, Side
from sagittal.core.message import Message
from sagittal.core.norms.lookup import Norms, look_up_norms
from sagittal.core.norms.tables import wbds_group
from sagittal.core.parameters.anatomical_zero import anatomical_curves
from sagittal.core.parameters.catalogue import CurveFigure
from sagittal.core.parameters.catalogue.errors import LEVELS
from sagittal.core.parameters.flats import OTHER
from sagittal.core.parameters.kinematic import NO_STANDING, stride_figures
from sagittal.core.parameters.result import CycleCurves, Parameter
from sagittal.core.parameters.variability import NORMAL_95, TOO_FEW, Spread, differ, mean_and_sd

Zero = Literal["anatomical", "standing"]

SMALLEST: Final = 1e-6
"""A side that is not larger than this has no ratio."""


@dataclass(frozen=True)
class Flag:
    """One rule applied to one side: a value against a limit, never a diagnosis.

    Parameters
    ----------
    side : side of the value; for a ratio the larger side, None without a ratio.
    value, unit : measured, mean over `n` counted strides. limit, beyond : exceeded when above or below it.
    exceeded : None if undecided, with `reason`: "angle_zero_standing" (the level needs
        goniometer angles), "joint_missing", "no_strides", "gap", "no_controls" (no control group of the
        clinic has the measure), "no_norm_for_age", "no_speed_matched_norm" (the limit comes from healthy
        adults, none of whom walked at this speed), "side_missing", "too_few_strides", "sides_alike" (limit
        exceeded, but the sides do not differ significantly), or the reason of the parameter.
    marked : the second, stricter limit is exceeded too.
    zero : zero of an angle, None if it does not matter.
    source : reference of the limit. verified : False = displayed as "unverified cut-off".
    note : "sides_stand_differently": the difference of two angles relative to standing includes the asymmetry
    of the standing posture.
    spread : sd of the healthy sample the limit is based on, None for other limits.
    certain : the limit is exceeded by more than the 95 % uncertainty from strides and measurement; False if
    unknown.
    """

    name: str
    side: Side | None
    measure: str
    kind: Kind
    value: float | None
    unit: str
    limit: float | None
    beyond: Beyond
    exceeded: bool | None
    source: str
    verified: bool
    n: int = 0
    marked: bool = False
    zero: Zero | None = None
    reason: str | None = None
    note: str | None = None
    spread: float | None = None
    certain: bool = False


@dataclass(frozen=True)
class _Value:
    mean: float | None
    n: int = 0
    reason: str | None = None
    sd: float | None = None
    own: float = 0.0


@dataclass(frozen=True)
class _Values:
    """Measured values by measure and side: parameters, angles relative to standing, anatomical angles."""

    plain: Mapping[tuple[str, Side], _Value]
    standing: Mapping[tuple[str, Side], _Value] = field(default_factory=dict)
    anatomical: Mapping[tuple[str, Side], _Value] = field(default_factory=dict)


def judge_flags(
    curves: CycleCurves | None,
    parameters: Sequence[Parameter],
    standing_deg: Mapping[str, float] | None = None,
    height_m: float | None = None,
    controls: Norms | None = None,
    age: float | None = None,
) -> tuple[Flag, ...]:
    """Apply every rule to both sides.

    Parameters
    ----------
    curves : relative to standing; None without joint angles. parameters : of the session.
    standing_deg : goniometer angles in standing (`sagittal.core.subject.standing_angles`).
    height_m : m, for the dimensionless speed.
    controls : the clinic's control group (`ControlGroup.norms`), for rules with limits based on it.
    age : years; limits based on adult norms are not applied below 18. None = adult.

    Returns
    -------
    One flag per rule and side in the order of `RULES`; one per rule for ratios.
    """
    values = _values(curves, parameters, standing_deg or {})
    speed = next((p.mean for p in parameters if p.name == "gait_speed_mps"), None)
    adults = look_up_norms(None, None, speed, height_m)
    child = wbds_group(age) is None
    result: list[Flag] = []
    for rule in RULES:
        limited = _with_limit(_at_speed(rule, adults), controls)
        if rule.kind == "ratio":
            result.append(_ratio(limited, values))
            continue
        for side in SIDES:
            flag = _difference(limited, side, values) if rule.kind == "difference" else None
            flag = flag or _level(limited, side, values)
            if limited.adults == "limit" and (child or adults.reason is not None):
                missing = "no_norm_for_age" if child else adults.reason
                reason = missing if flag.value is not None else flag.reason
                flag = replace(flag, limit=None, exceeded=None, marked=False, certain=False, reason=reason)
            result.append(flag)
    return tuple(result)


def _values(
    curves: CycleCurves | None, parameters: Sequence[Parameter], standing_deg: Mapping[str, float]
) -> _Values:
    plain = {
        (p.name, p.side): _Value(p.mean, p.n, p.reason, p.sd, p.u_own or 0.0)
        for p in parameters
        if p.side is not None
    }
    for side in SIDES:
        swing, stance = plain.get(("swing_time_s", side)), plain.get(("stance_time_s", side))
        if swing is not None and stance is not None and swing.mean is not None and stance.mean:
            ratio = swing.mean / stance.mean
            # at most: the two of a stride may vary against each other
            sd = (
                None
                if swing.sd is None or stance.sd is None
                else (swing.sd + ratio * stance.sd) / stance.mean
            )
            plain[SWING_TO_STANCE, side] = _Value(ratio, min(swing.n, stance.n), sd=sd)
    if curves is None:
        return _Values(plain)
    return _Values(plain, _figures(curves), _figures(anatomical_curves(curves, standing_deg)))


_JUDGED: Final = {rule.measure: CURVES[rule.measure] for rule in RULES if rule.measure in CURVES}
"""What the rules read of the curves."""


def _figures(curves: CycleCurves) -> dict[tuple[str, Side], _Value]:
    """Means over the counted strides of the curve parameters used by the rules."""
    figures: dict[tuple[str, Side], _Value] = {}
    for name, sides in stride_figures(curves, _JUDGED).items():
        level = CURVES[name].statistic != "range"
        for side, values in sides.items():
            if level and curves.zero == "walking":
                figures[name, side] = _Value(None, 0, NO_STANDING)
                continue
            selected = values[curves.used[side]]
            whole = selected[np.isfinite(selected)]
            if len(whole):
                mean, sd = mean_and_sd(whole)
                figures[name, side] = _Value(mean, len(whole), sd=sd, own=_own(CURVES[name]))
            else:
                figures[name, side] = _Value(None, 0, "gap" if len(selected) else "no_strides")
    return figures


def _own(figure: CurveFigure) -> float:
    """Systematic error of one side of a curve parameter, degrees; 0 if never determined."""
    errors = LEVELS.get(figure.variable)
    if errors is None:
        return 0.0
    return errors.own * (sqrt(2.0) if figure.statistic == "range" else 1.0)


def _at_speed(rule: Rule, adults: Norms) -> Rule:
    """The rule with the limits of healthy adults at the speed of these norms.

    If no adult walked at that speed, a primary limit is kept for `judge_flags` to withdraw, and a second one
    is dropped. Limits on side differences do not depend on the speed.
    """
    if rule.adults is None or rule.kind == "difference":
        return rule
    if adults.reason is not None:
        return replace(rule, marked=None) if rule.adults == "marked" else rule
    norm = adults.values[rule.measure]
    beyond = norm.mean + (2.0 if rule.beyond == "above" else -2.0) * norm.sd
    if rule.adults == "marked":
        return replace(rule, marked=beyond)
    return replace(
        rule, limit=beyond, spread=norm.sd, source=Message("mean + 2 SD, {source}", source=norm.source)
    )


def _with_limit(rule: Rule, controls: Norms | None) -> Rule:
    """The rule with the limit of the clinic's controls, if it has no limit and the controls include the
    measure.
    """
    if rule.limit is not None or controls is None or rule.measure not in controls.values:
        return rule
    norm = controls.values[rule.measure]
    sign = 1.0 if rule.beyond == "above" else -1.0
    return replace(rule, limit=norm.mean + sign * 2.0 * norm.sd, source=f"{rule.source}: {norm.source}")


def _level(rule: Rule, side: Side, values: _Values) -> Flag:
    """Flag on the value of one side."""
    key = rule.measure, side
    if rule.measure not in CURVES:
        return _flag(rule, side, values.plain.get(key) or _Value(None, 0, "no_strides"), None)
    if key in values.anatomical:
        return _flag(rule, side, values.anatomical[key], "anatomical")
    value = values.standing.get(key) or _Value(None, 0, "joint_missing")
    flag = _flag(rule, side, value, "standing")
    if rule.level and value.mean is not None:
        return replace(flag, exceeded=None, marked=False, reason="angle_zero_standing")
    return flag


def _difference(rule: Rule, side: Side, values: _Values) -> Flag:
    """Flag on the other side minus this side, both relative to the same zero."""
    own, opposite = (rule.measure, side), (rule.measure, OTHER[side])
    free = CURVES[rule.measure].statistic == "range"
    both_anatomical = own in values.anatomical and opposite in values.anatomical
    table = values.anatomical if both_anatomical and not free else values.standing
    zero: Zero | None = None if free else "anatomical" if both_anatomical else "standing"
    a, b = table.get(own), table.get(opposite)
    if a is None or b is None:
        return _flag(rule, side, _Value(None, 0, "joint_missing" if a is None else "side_missing"), zero)
    if a.mean is None or b.mean is None:
        return _flag(rule, side, _Value(None, 0, a.reason or "side_missing"), zero)
    flag = _clear(_flag(rule, side, _Value(b.mean - a.mean, min(a.n, b.n)), zero), a, b)
    return replace(flag, note="sides_stand_differently") if zero == "standing" else flag


def _ratio(rule: Rule, values: _Values) -> Flag:
    """Flag on the larger side over the smaller side; it is assigned to the larger."""
    left, right = (values.plain.get((rule.measure, s)) or _Value(None, 0, "no_strides") for s in SIDES)
    if left.mean is None or right.mean is None:
        missing_reason = left.reason if left.mean is None else right.reason
        return _flag(rule, None, _Value(None, 0, missing_reason or "side_missing"), None)
    small, large = sorted((left.mean, right.mean))
    if small <= SMALLEST:
        return _flag(rule, None, _Value(None, 0, "near_zero"), None)
    side: Side = "left" if left.mean >= right.mean else "right"
    return _clear(_flag(rule, side, _Value(large / small, min(left.n, right.n)), None), left, right)


def _clear(flag: Flag, a: _Value, b: _Value) -> Flag:
    """Withdraw a flag if the strides of the two sides overlap so far that either could be the larger."""
    if not flag.exceeded or a.mean is None or b.mean is None:
        return flag
    if differ(Spread(a.mean, a.sd, a.n, a.own), Spread(b.mean, b.sd, b.n, b.own)):
        return flag
    return replace(flag, exceeded=None, marked=False, reason="sides_alike")


def _flag(rule: Rule, side: Side | None, value: _Value, zero: Zero | None) -> Flag:
    exceeded, reason, marked = None, value.reason, False
    if value.mean is not None:
        if rule.limit is None:
            reason = "no_controls"
        elif value.n < COMPARED:
            reason = TOO_FEW
        else:
            exceeded = _beyond(value.mean, rule.limit, rule.beyond)
            marked = rule.marked is not None and _beyond(value.mean, rule.marked, rule.beyond)
    return Flag(
        name=rule.name,
        side=side,
        measure=rule.measure,
        kind=rule.kind,
        value=value.mean,
        unit=rule.unit,
        limit=rule.limit,
        beyond=rule.beyond,
        exceeded=exceeded,
        source=rule.source,
        verified=rule.verified,
        n=value.n,
        marked=marked,
        zero=zero if value.mean is not None else None,
        reason=reason,
        spread=rule.spread,
        certain=bool(exceeded) and _is_certain(value, rule.limit),
    )


def _is_certain(value: _Value, limit: float | None) -> bool:
    """Whether the 95 % interval of a value excludes its limit."""
    if value.mean is None or value.sd is None or limit is None:
        return False
    return abs(value.mean - limit) > NORMAL_95 * hypot(value.sd / sqrt(value.n), value.own)


def _beyond(value: float, limit: float, beyond: Beyond) -> bool:
    return value > limit if beyond == "above" else value < limit
