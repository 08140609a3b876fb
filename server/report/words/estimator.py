"""Wording of the pose estimator, its input, and its self-assessment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from sagittal.core.estimators import (
    AUTO,
    BY_METHOD,
    BY_NAME,
    NO_FIGURE,
    NO_FIGURE_LABEL,
    NO_FIGURE_NOTE,
    PaperReference,
)
from sagittal.core.message import Message
from sagittal.server.report.words.wording import format_number, place_words

KINDS: Final[Mapping[str, str]] = {"good": "ok", "warn": "warn", "bad": "bad"}
VERDICTS: Final[Mapping[str, str]] = {
    "good": "consistent",
    "warn": "partly unreliable",
    "bad": "inconsistent",
}
NOT_JUDGED: Final = "has no self-check"
"""For an estimator without health limits."""

REDUCED: Final[Mapping[str, str]] = {
    "sensor_failed": "reduced: a sensor failed in this trial",
    "not_calibrated": "reduced: the facing direction of a sensor is unknown",
    "no_standing": "none: no usable quiet standing in this trial",
    "estimator_failed": "reduced: the preferred estimator could not finish",
}

QUANTITIES: Final[Mapping[str, tuple[str, int, str]]] = {
    "joint_residual_mm": ("Joint separation", 0, "mm"),
    "zero_velocity_refused_pct": ("Rejected foot-flat periods", 1, "%"),
    "contact_pct": ("Foot-flat, share of the trial", 0, "%"),
    "longest_moving_s": ("Longest time without foot-flat", 1, "s"),
    "climb_pct": ("Floor inclination, share of the distance", 1, "%"),
    "gap_s": ("Longest data loss", 1, "s"),
    "start_heading_off_deg": ("Initial heading error", 0, "°"),
    "heading_sd_deg": ("Heading uncertainty", 1, "°"),
    "min_eigenvalue": ("Smallest eigenvalue of P", 0, ""),
    "forward_axis_turned_deg": ("Anterior axis rotated", 0, "°"),
    "leg_excess_mm": ("Leg over-extended", 1, "mm"),
    "hinge_mm": ("Hinge violation", 1, "mm"),
    "knee_straight_pct": ("Knee fully extended", 0, "%"),
    "foot_turned_deg": ("Foot sensor rotated", 0, "°"),
    "feet_out_of_place_pct": ("Feet not under the hips", 0, "%"),
    "phase_off_pct": ("Deviation from alternation", 0, "% of a stride"),
    "toward_foot_mps2": ("Pelvis acceleration towards the stance foot", 2, "m/s²"),
    "inner_foot_m": ("Inner foot ahead in turns; sides undecided up to the limit", 2, "m/rad"),
    "pelvis_rise_cm": ("Vertical pelvis excursion", 0, "cm"),
    "places_moved_mm": ("Residual position change", 1, "mm"),
    "pelvis_tilt_sd_deg": ("Pelvis tilt, standard deviation", 1, "°"),
}
"""Name of a finding → label, decimals, unit."""

HIDDEN: Final = ("min_eigenvalue",)
"""Measures for verification: in analysis.json, not on the page."""


@dataclass(frozen=True)
class HealthRow:
    """One health measure: worst value and its location, limit, and result."""

    label: str
    where: str
    text: str
    limit: str
    kind: str


@dataclass(frozen=True)
class EstimatorView:
    """The estimator of an analysis.

    Parameters
    ----------
    kind, verdict : ok, warn or bad and its word. reduced : words, None if all sensors could be used.
    choices : (value, words, selected) of estimators available for these sensors.
    estimated : sentence about estimated angles, empty if there are none.
    paper : reference of the method; None = our own, or unknown to this version.
    """

    name: str
    meaning: str
    sensors: int
    kind: str
    verdict: str
    reduced: str | None
    health: tuple[HealthRow, ...]
    choices: tuple[tuple[str, str, bool], ...]
    estimated: str
    paper: PaperReference | None


def estimator_view(e: Mapping[str, Any] | None) -> EstimatorView | None:
    """View of `estimator` in analysis.json; None if the analysis stopped before the poses."""
    if e is None:
        return None
    name, verdict, requested = str(e["name"]), str(e["verdict"]), str(e["requested"])
    reduced = e["reduced"]
    is_judged = any(f["warn"] is not None or f["bad"] is not None for f in e["health"])
    return EstimatorView(
        name=method_label(name),
        meaning=_method_note(name),
        sensors=len(e["sensors"]),
        kind=KINDS[verdict],
        verdict=VERDICTS[verdict] if is_judged else NOT_JUDGED,
        reduced=None if reduced is None else REDUCED.get(reduced, str(reduced)),
        health=_rows(e["health"]),
        choices=(
            (AUTO, "Automatic: best for the sensors in use", requested == AUTO),
            *((x, choice_label(x), requested == x) for x in e["possible"]),
        ),
        estimated=_estimated(_told(list_estimated_angles(e), name)),
        paper=BY_METHOD[name].paper if name in BY_METHOD else None,
    )


def method_label(method: str) -> str:
    """Label of `Poses.method`; unchanged if unknown to this version."""
    estimator = BY_METHOD.get(method)
    return estimator.label if estimator is not None else NO_FIGURE_LABEL if method == NO_FIGURE else method


def choice_label(name: str) -> str:
    """Label of an estimator in forms; unchanged if unknown to this version."""
    return BY_NAME[name].choice if name in BY_NAME else name


def _method_note(method: str) -> str:
    estimator = BY_METHOD.get(method)
    return estimator.note if estimator is not None else NO_FIGURE_NOTE if method == NO_FIGURE else ""


def list_estimated_angles(e: Mapping[str, Any] | None) -> frozenset[str]:
    """Angles with their side that are estimated by a model rather than measured by two sensors."""
    return frozenset() if e is None else frozenset(e["estimated_angles"])


def list_estimated_variables(e: Mapping[str, Any] | None) -> frozenset[str]:
    """Estimated variables without the side."""
    return frozenset(a.removesuffix("_l").removesuffix("_r") for a in list_estimated_angles(e))


def _told(angles: frozenset[str], method: str) -> frozenset[str]:
    """Angles that are results rather than fixed by the model."""
    fixed = BY_METHOD[method].fixed if method in BY_METHOD else ()
    return frozenset(a for a in angles if a.removesuffix("_l").removesuffix("_r") not in fixed)


def _estimated(angles: frozenset[str]) -> str:
    if not angles:
        return ""
    joints = sorted({a.split("_")[0] for a in angles})
    sides = {"l": "left", "r": "right"}
    on = sorted({sides[a[-1]] for a in angles if a[-2:] in ("_l", "_r")})
    region = "both sides" if len(on) > 1 else Message("the {on} side", on=on[0]) if on else "the pelvis"
    return Message(
        "{join} angles of {region} are estimated by the leg model rather than measured by two sensors: "
        "low confidence.",
        join=", ".join(joints).capitalize(),
        region=region,
    )


def _rows(health: list[Mapping[str, Any]]) -> tuple[HealthRow, ...]:
    """The worst value of each measure, assessed ones first."""
    worst: dict[str, Mapping[str, Any]] = {}
    for f in health:
        was = worst.get(f["name"])
        if was is None or f["value"] is None or (was["value"] is not None and f["value"] > was["value"]):
            worst[f["name"]] = f
    measures = [f for name, f in worst.items() if name not in HIDDEN]
    measures.sort(key=lambda f: f["warn"] is None and f["bad"] is None)
    return tuple(_row(f) for f in measures)


def _row(f: Mapping[str, Any]) -> HealthRow:
    name = str(f["name"])
    label, digits, unit = QUANTITIES.get(name, (name.replace("_", " ").capitalize(), 2, ""))
    gap = "" if unit == "°" else "\u202f"
    limit = f["bad"] if f["warn"] is None else f["warn"]
    location = " and ".join(place_words(part) for part in str(f["of"] or "").split("-") if part)
    return HealthRow(
        label=label,
        where=location,
        text="not measured"
        if f["value"] is None
        else f"{format_number(float(f['value']), digits)}{gap}{unit}",
        limit=""
        if limit is None
        else f"≤ {format_number(float(limit), 0 if float(limit).is_integer() else digits)}{gap}{unit}",
        kind=KINDS[str(f["verdict"])],
    )
