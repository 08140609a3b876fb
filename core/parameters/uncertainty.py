"""Value ± uncertainty: contributions of the strides and of the measurement.

docs/science/uncertainty.md. The error of a single stride averages out over many, that of a foot, a
calibration or a definition does not. Three parts are kept because they apply differently: errors common to
both sides and all recordings cancel in a difference of sides or visits, but not in a value.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, sqrt
from typing import Final

import numpy as np

from sagittal.core.events.result import MANUAL, EventKind, GaitEvents
from sagittal.core.frames import SIDES, SUFFIX, Side
from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.core.parameters.catalogue.errors import ContactWeights
from sagittal.core.parameters.flats import OTHER
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.variability import NORMAL_95, t_quantile

GONIOMETER_DEG: Final = 3.0
"""Standing angle read with a goniometer, standard. Our estimate: readings of two people differ by 3 to 5°."""

ESTIMATED_DEG: Final[Mapping[str, float]] = {"hip": 7.5, "knee": 10.5, "ankle": 5.5}
"""Joint → RMS error of a level or range that pelvis and feet do not measure: the worst of maximum, minimum,
range, contact and mean of a stride, over neura_walk, qmt_fullbody and simulated people with and without
disease (validation/report.md, "L7S: levels and ranges" and "L7S: parameters of whole analyses"). The knee's
is that of people who stand with bent knees."""

FEET_ALONE_DEG: Final[Mapping[str, float]] = {"hip": 9.0, "knee": 11.0, "ankle": 7.0}
"""The same from the feet alone."""

FEET_ALONE_AT_CONTACT_DEG: Final[Mapping[str, float]] = {"knee": 12.5}
"""The same of the angle at contact, which feet alone find at another moment: the knee is 10° more bent than
it is (validation/report.md, "L7S: parameters of whole analyses")."""


@dataclass(frozen=True)
class ContactErrors:
    """Standard uncertainties of contact times in s.

    Parameters
    ----------
    contact, foot_off : common to both feet and all recordings: deviation of the rule from the definition, and
        of the references from each other. foot : of one foot in one recording. random : of a single event.
    """

    contact: float
    foot_off: float
    foot: float
    random: float


PITCH_RULE: Final = ContactErrors(contact=0.031, foot_off=0.031, foot=0.010, random=0.015)
"""Turning points of the foot's pitch: RMS of their mean errors by person on ipol_walks (4), gaitmap_foot (2
feet) and force_plate_steps: contact −54 to +5 ms, foot-off +17 to +44 ms."""

REFINED: Final = ContactErrors(contact=0.014, foot_off=0.012, foot=0.006, random=0.014)
"""Events that state their own uncertainty, where that is `TYPICAL_S`: SD of the mean errors by person on the
same sets (contact −19 to +22 ms), by laboratory for foot-off (+5, +6, −14 ms, rounded up: its persons are of
one), and what is left of 20 ms within a walk."""

WITHOUT_FOOT_S: Final = 0.050
"""Events vaguer than this are of a shank or a trunk: how they err depends on how a leg swings, and so on the
side (a simulated hemiparetic walk with shanks alone: contacts 90 ms apart in error between the sides)."""

TYPICAL_S: Final = 0.020
"""Stated uncertainty of an event that `REFINED` describes; another one scales it."""


def state_uncertainty(
    parameters: Sequence[Parameter],
    events: GaitEvents | None = None,
    estimated: Collection[str] = (),
    *,
    goniometer: bool = False,
    feet_lag_s: float = 0.0,
) -> tuple[Parameter, ...]:
    """The parameters with their uncertainty; unchanged without a value or a declared error.

    A single stride has the measurement contributions and no `uncertainty`: the spread of strides is unknown.

    Parameters
    ----------
    parameters : of one recording. events : used to measure them, for the uncertainty of contacts. estimated :
        angles, with their side, that are not measured by two sensors. goniometer : a standing angle was added
        to the levels. feet_lag_s : standard uncertainty of the clock offset of one foot, if not determined by
        a link between the feet.
    """
    contacts = _contact_errors(events)
    strides = {p.side: p.mean for p in parameters if p.name == "stride_time_s"}
    return tuple(
        _stated(p, contacts, strides, estimated, feet_lag_s, goniometer=goniometer)
        for p in mark_estimated(parameters, estimated)
    )


def mark_estimated(parameters: Sequence[Parameter], angles: Collection[str]) -> tuple[Parameter, ...]:
    """The parameters, with those derived from these angles of the same side marked as estimated."""
    return tuple(
        replace(p, estimated=True) if is_estimated(p.name, p.side, angles) else p for p in parameters
    )


def is_estimated(name: str, side: Side | None, angles: Collection[str]) -> bool:
    """Whether a parameter is derived from one of these angles; those of the pelvis have no side."""
    variable = _variable(name)
    if variable is None:
        return False
    return variable in angles or (side is not None and f"{variable}_{SUFFIX[side]}" in angles)


def _variable(name: str) -> str | None:
    """The curve from which a parameter is derived."""
    entry = CATALOGUE.get(name)
    return None if entry is None or entry.curve is None else entry.curve.variable


def difference_half_width(strides: float, *own: float | None) -> float:
    """95 % half width of a difference of two values, from that of their strides and their measurement
    errors.
    """
    return hypot(strides, NORMAL_95 * hypot(*(u or 0.0 for u in own)))


def _stated(
    p: Parameter,
    contacts: Mapping[Side, ContactErrors],
    strides: Mapping[Side | None, float | None],
    estimated: Collection[str],
    feet_lag_s: float,
    *,
    goniometer: bool,
) -> Parameter:
    entry = CATALOGUE.get(p.name)
    if p.mean is None or p.n < 1 or entry is None or entry.errors is None:
        return p
    errors = entry.errors
    variable = _variable(p.name)
    if variable is not None and p.estimated:
        joint = variable.partition("_")[0]
        joint_errors = FEET_ALONE_DEG if "pelvis_tilt" in estimated else ESTIMATED_DEG
        if joint_errors is FEET_ALONE_DEG and entry.curve is not None and entry.curve.statistic == "at":
            joint_errors = {**joint_errors, **FEET_ALONE_AT_CONTACT_DEG}
        errors = replace(errors, own=max(errors.own, joint_errors.get(joint, errors.own)))
    common, own, random = errors.common, errors.own, errors.random
    if errors.contacts is not None:
        in_s = _of_contacts(errors.contacts, contacts, p.side, feet_lag_s)
        scale = _per_second(p, strides)
        if scale is None:
            return p
        common, own, random = (hypot(a, scale * b) for a, b in zip((common, own, random), in_s, strict=True))
    if goniometer and variable is not None and not p.name.endswith("_rom_deg"):
        own = hypot(own, GONIOMETER_DEG)
    if p.sd is None:  # one stride says nothing of how strides differ
        return replace(p, u_own=own, u_common=common)
    open_by_strides = max(t_quantile(p.n - 1) * p.sd, NORMAL_95 * random) / sqrt(p.n)
    whole = hypot(open_by_strides, NORMAL_95 * hypot(own, common))
    return replace(p, uncertainty=whole, u_own=own, u_common=common)


def _per_second(p: Parameter, strides: Mapping[Side | None, float | None]) -> float | None:
    """Conversion of a second to the parameter's unit; None for a percentage of a stride of unknown length."""
    if p.unit != "%":
        return 1.0
    stride = strides.get(p.side)
    return None if not stride else 100.0 / stride


def _of_contacts(
    w: ContactWeights, contacts: Mapping[Side, ContactErrors], side: Side | None, feet_lag_s: float
) -> tuple[float, float, float]:
    """Common, own and random error of a time in s, from those of its contacts."""
    one: Side = side or "left"
    a, b = contacts[one], contacts[OTHER[one]]
    # the same rule finds a kind of event on both feet: their shared errors add with their signs
    contact = (w.start + w.end) * a.contact + w.other * b.contact
    foot_off = w.off * a.foot_off + w.other_off * b.foot_off
    # contacts of one foot share an error of that foot; so do its foot-offs
    own = [(w.start + w.end) * a.foot, w.off * a.foot, w.other * b.foot, w.other_off * b.foot]
    own.append((w.other + w.other_off) * feet_lag_s)  # a late clock delays all events of its foot
    random = hypot(
        w.start * a.random, w.off * a.random, w.end * a.random, w.other * b.random, w.other_off * b.random
    )
    return hypot(contact, foot_off), hypot(*own), random


def _contact_errors(events: GaitEvents | None) -> dict[Side, ContactErrors]:
    """Errors for the events of each foot: as stated by the events, else those of the pitch rule.

    A manual event counts as `TYPICAL_S`: people who mark the same signal differ by as much.
    """
    stated_errors: dict[tuple[Side, EventKind], list[float]] = {}
    for e in () if events is None else events.events:
        stated = TYPICAL_S if e.source == MANUAL else e.uncertainty_s
        if stated is not None:
            stated_errors.setdefault((e.side, e.kind), []).append(stated)
    return {
        side: _foot_errors(stated_errors.get((side, "ic")), stated_errors.get((side, "tc"))) for side in SIDES
    }


def _foot_errors(contacts: Sequence[float] | None, leavings: Sequence[float] | None) -> ContactErrors:
    """Errors of a foot, from the uncertainties of its contacts and foot-offs in s."""
    if not contacts or not leavings:
        return PITCH_RULE
    ic, tc = (float(np.sqrt(np.mean(np.square(x)))) / TYPICAL_S for x in (contacts, leavings))
    combined = hypot(ic, tc) / sqrt(2.0)
    foot = REFINED.foot if combined * TYPICAL_S <= WITHOUT_FOOT_S else REFINED.contact
    return ContactErrors(
        REFINED.contact * ic, REFINED.foot_off * tc, foot * combined, REFINED.random * combined
    )
