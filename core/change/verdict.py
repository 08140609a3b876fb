"""Compare two sessions: changes within measurement error, real changes, clinically relevant changes.

docs/science/change.md, "Verdict". A change is "real" only above the MDC, "clinically relevant" only above
both MDC and MCID. A published MDC assumes enough strides: the limit is never smaller than the uncertainty due
to the strides of the two sessions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot
from typing import Final, Literal

from sagittal.core.change.limits import (
    ChangeLimit,
    Limb,
    Repeatability,
    detectable_ratio,
    find_detectable_change,
    find_relevant_change,
)
from sagittal.core.frames import Side
from sagittal.core.norms.place import place_value
from sagittal.core.norms.scores import Score
from sagittal.core.norms.values import NormValue
from sagittal.core.parameters.kinematic import is_level
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.symmetry import Symmetry
from sagittal.core.parameters.uncertainty import difference_half_width
from sagittal.core.parameters.variability import TOO_FEW, has_enough_values

Verdict = Literal["within_measurement_error", "real_change", "clinically_relevant"]

STRIDES: Final = "strides and measurement of the two visits, 95 %"
"""Source of a limit that comes from the spread of the strides alone."""

UNLIKE: Final = "conditions_differ"
"""Reason of a change between takes that were not walked alike (core/subject/condition.py)."""

NOT_MEASURED_ALIKE: Final = "not_measured_alike"
"""Reason of no change between an angle that a model of the leg estimated and one that sensors measured."""


@dataclass(frozen=True)
class Change:
    """One parameter in two sessions; above `limit` (MDC) the change is real, above `mcid` also relevant.

    Parameters
    ----------
    before, after : values; difference = after − before, in `unit`.
    limit, limit_source, people : threshold for a real change; None without a source.
    mcid, mcid_source : threshold for a relevant change; None without a source.
    verdict : None with a `reason`: "no_value" (missing in one session, or available for different sides),
        "not_measured_alike" (one is estimated, the other measured: no difference either), "too_few_strides"
        in one of them, "no_mdc" (no published limit), "conditions_differ" (different walking conditions,
        core/subject/condition.py).
    towards_norm : whether the distance from the norm mean, in standard deviations, decreased, each visit
    compared at its own speed; None if one of them has no comparable norm.
    note : "from_standing": includes any change in standing posture.
    """

    name: str
    side: Side | None
    unit: str
    before: float | None
    after: float | None
    difference: float | None
    verdict: Verdict | None
    limit: float | None
    limit_source: str | None
    people: str | None
    mcid: float | None
    mcid_source: str | None
    towards_norm: bool | None
    reason: str | None
    note: str | None


def parameter_changes(
    previous: Sequence[Parameter],
    current: Sequence[Parameter],
    affected: Side | None = None,
    norms: tuple[Mapping[str, NormValue], Mapping[str, NormValue]] | None = None,
    own: Mapping[str, Repeatability] | None = None,
) -> tuple[Change, ...]:
    """Compare the parameters of two sessions, in the order of the later session.

    Parameters
    ----------
    affected : side, None = none or both.
    norms : reference values by name, per session at its own speed; without them changes have no direction.
    own : measurement error of this clinic by name; takes precedence over published limits.
    """
    earlier = {(p.name, p.side): p for p in previous}
    of_before, of_after = norms or ({}, {})
    return tuple(
        _parameter(
            earlier.get((p.name, p.side)),
            p,
            affected,
            (of_before.get(p.name), of_after.get(p.name)),
            (own or {}).get(p.name),
        )
        for p in current
    )


def ratio_changes(previous: Sequence[Symmetry], current: Sequence[Symmetry]) -> tuple[Change, ...]:
    """Compare the side ratios of two sessions; limits exist only for ratios affected / unaffected."""
    earlier = {s.name: s for s in previous}
    changes = []
    for s in current:
        was = earlier.get(s.name)
        alike = was is not None and (was.first, was.reference) == (s.first, s.reference)
        old = was.ratio if was is not None and alike else None
        change = _plain(f"{s.name}_ratio", None, "", old, s.ratio)
        mdc = detectable_ratio(s.name) if s.reference == "affected/unaffected" else None
        changes.append(_judged(change, mdc, None))
    return tuple(changes)


def score_changes(
    previous: Sequence[Score], current: Sequence[Score], own: Mapping[str, Repeatability] | None = None
) -> tuple[Change, ...]:
    """Compare the scores of two sessions, raw with raw and shape with shape; names as `score_name`.

    No source reports an MDC of the GPS; without the clinic's own there is no verdict.
    """
    earlier = {(score_name(s), s.side): s.value for s in previous}
    changes = []
    for s in current:
        name = score_name(s)
        mine = (own or {}).get(name)
        change = _plain(name, s.side, s.unit, earlier.get((name, s.side)), s.value)
        if change.difference:
            # a score in degrees is a distance from the norm, an index grows towards it
            change = replace(change, towards_norm=(change.difference < 0.0) == (s.unit == "deg"))
        mcid = find_relevant_change(s.name) if s.mode == "raw" else None
        changes.append(_judged(change, None if mine is None else mine.limit, mcid))
    return tuple(changes)


def withdraw_verdicts(change: Change) -> Change:
    """Keep the differences between recordings under different conditions, without verdict and direction."""
    if change.difference is None:
        return change
    return replace(change, verdict=None, towards_norm=None, reason=UNLIKE)


def score_name(score: Score) -> str:
    """Name of a score across sessions: "gps_sagittal_deg raw", "gvs_deg knee_flexion offset_removed"."""
    return " ".join(part for part in (score.name, score.variable, score.mode) if part)


def _parameter(
    old: Parameter | None,
    new: Parameter,
    affected: Side | None,
    norms: tuple[NormValue | None, NormValue | None],
    own: Repeatability | None,
) -> Change:
    change = _plain(new.name, new.side, new.unit, None if old is None else old.mean, new.mean)
    if old is None or old.mean is None or new.mean is None:
        return change
    if old.estimated != new.estimated:
        return replace(change, difference=None, reason=NOT_MEASURED_ALIKE)
    if not (has_enough_values(old) and has_enough_values(new)):
        return replace(change, reason=TOO_FEW)
    limb: Limb | None = None
    if affected is not None and new.side is not None:
        limb = "affected" if new.side == affected else "unaffected"
    mdc = find_detectable_change(new.name, old.mean, limb) if own is None else own.limit
    open_by_strides = _strides(old, new)
    if mdc is not None and open_by_strides > mdc.value:
        mdc = ChangeLimit(open_by_strides, "these visits", STRIDES)
    was, now = (place_value(p.mean, norm).z for p, norm in zip((old, new), norms, strict=True))
    if was is not None and now is not None and abs(was) != abs(now):
        change = replace(change, towards_norm=abs(now) < abs(was))
    if is_level(new.name):
        change = replace(change, note="from_standing")
    return _judged(change, mdc, find_relevant_change(new.name, limb))


def _strides(old: Parameter, new: Parameter) -> float:
    """Half width of the confidence interval of a difference of two means: strides and per-recording
    uncertainty.

    Errors common to both recordings, such as the definition of a contact, cancel in the difference.
    """
    halves = [
        0.5 * (p.ci_high - p.ci_low) for p in (old, new) if p.ci_low is not None and p.ci_high is not None
    ]
    of_strides = hypot(*halves) if len(halves) == 2 else 0.0
    return difference_half_width(of_strides, old.u_own, new.u_own)


def _plain(name: str, side: Side | None, unit: str, previous: float | None, current: float | None) -> Change:
    difference = None if previous is None or current is None else current - previous
    return Change(
        name=name,
        side=side,
        unit=unit,
        before=previous,
        after=current,
        difference=difference,
        verdict=None,
        limit=None,
        limit_source=None,
        people=None,
        mcid=None,
        mcid_source=None,
        towards_norm=None,
        reason="no_value" if difference is None else None,
        note=None,
    )


def _judged(change: Change, mdc: ChangeLimit | None, mcid: ChangeLimit | None) -> Change:
    if mcid is not None:
        change = replace(change, mcid=mcid.value, mcid_source=f"{mcid.source} ({mcid.people})")
    if mdc is not None:
        change = replace(change, limit=mdc.value, limit_source=mdc.source, people=mdc.people)
    if change.difference is None:
        return change
    if mdc is None:
        return replace(change, reason="no_mdc")
    size = abs(change.difference)
    if size <= mdc.value:
        return replace(change, verdict="within_measurement_error")
    beyond = mcid is not None and size > mcid.value
    return replace(change, verdict="clinically_relevant" if beyond else "real_change")
