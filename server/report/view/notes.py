"""Notes on tables and curves: reference groups and zeros."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from sagittal.core.message import Message
from sagittal.core.norms.at_speed import ASKED, SOURCE
from sagittal.core.norms.controls import ControlGroup
from sagittal.core.norms.lookup import Norms
from sagittal.core.norms.values import is_angle
from sagittal.server.report.charts.panels import DRAWN_STRIDES, CurvePanel
from sagittal.server.report.files.bundle import Bundle
from sagittal.server.report.view.table import FEW_NOTE, ParameterRow
from sagittal.server.report.words.estimator import estimator_view
from sagittal.server.report.words.wording import GROUPS, NO_NORM, VARIABLES, format_number

SPEED: Final = "gait_speed_mps"


def norm_note(
    rows: Sequence[ParameterRow],
    panels: Sequence[CurvePanel],
    norms: Norms,
    controls: ControlGroup | None = None,
) -> str:
    """Reference group, or the reason why there is none; never empty."""
    sentences = []
    if norms.reason is not None:
        sentences.append(NO_NORM.get(norms.reason, norms.reason))
    used = any(p.norm is not None and p.norm.zero == "anatomical" for p in panels)
    angles = used or any(r.norm is not None and is_angle(r.name) for r in rows)
    matched = bool(norms.comfortable_bands)
    if matched and any(r.norm_group == ASKED for r in rows):
        sentences.append(_matched_note(norms))
    bands = norms.comfortable_bands if matched else norms.bands
    band = next(iter(bands.values()), None)
    if band is not None and angles:
        group = GROUPS.get(band.group, band.group)
        sentences.append(
            Message(
                f"{'Comfortable' if matched else 'Norm'}: {{band}} {{group}}, overground at their "
                "comfortable 1.25 ± 0.16 m/s, mean ± 1 SD ({source}).",
                band=band.n,
                group=group,
                source=band.source,
            )
        )
    if norms.timing_reason is not None and norms.timing_reason != norms.reason:
        sentences.append(NO_NORM.get(norms.timing_reason, norms.timing_reason))
    elif displayed := [
        r
        for r in rows
        if r.norm is not None
        and r.norm_group != ASKED
        and r.name != SPEED
        and not is_angle(r.name)
        and r.unit != "°"
    ]:
        sentences.append(
            Message(
                "Timing: {group} ({norm_source}).",
                group=norms.values[displayed[0].name].group,
                norm_source=displayed[0].norm_source,
            )
        )
    if any(r.norm_note == FEW_NOTE for r in rows):
        sentences.append(FEW_NOTE)
    if any(r.name == SPEED and r.norm is not None for r in rows):
        usual = norms.values[SPEED]
        sentences.append(
            Message(
                "Gait speed: {group} ({source}).",
                group=GROUPS.get(usual.group, usual.group),
                source=usual.source,
            )
        )
    if controls is not None:
        sentences.append(_own_note(controls))
    return " ".join(sentences)


def _matched_note(norms: Norms) -> str:
    """Reference group that was asked to walk at this speed, and its limitations."""
    speed = "" if norms.speed is None else f" ({format_number(norms.speed.speed_mps, 2)}\u202fm/s)"
    return Message(
        "Norm: {ASKED}{speed}, overground, mean ± 1 SD ({SOURCE}). These people were asked to walk at "
        "this speed; they do not habitually walk slowly.",
        ASKED=ASKED,
        speed=speed,
        SOURCE=SOURCE,
    )


def _own_note(controls: ControlGroup) -> str:
    """Description of the clinic's own controls, or that there are too few."""
    if controls.reason is not None:
        return Message(
            "Own controls at the same speed: {controls}, too few for a comparison.", controls=controls.n
        )
    small = ", a small group" if controls.note == "small_group" else ""
    return Message(
        "Where no published norm is comparable: {group}, {controls} people{small}.",
        group=controls.group,
        controls=controls.n,
        small=small,
    )


def curve_notes(bundle: Bundle, panels: Sequence[CurvePanel]) -> tuple[str, ...]:
    """Explanations of the curves, in sentences: zero, offsets, confidence, elements."""
    if bundle.angles is None:
        return ()
    labels = {v.name: v.label.lower() for v in VARIABLES if v.plane == "sagittal"}
    offsets = []
    for name, value in bundle.angles.zero_offset.items():
        if name not in bundle.angles.angles:
            continue
        base, _, suffix = name.rpartition("_")
        side = {"l": " left", "r": " right"}.get(suffix)
        label = labels.get(base if side else name)
        if label is not None:
            offsets.append(f"{label}{side or ''} {format_number(float(np.degrees(value)))}°")
    about_zero: list[str] = []
    if any(p.zero == "standing" and p.reason is None for p in panels):
        about_zero.append(
            Message(
                "Curves relative to standing have the posture during quiet standing at 0°. Subtracted: "
                "{offsets}. If the person stands with flexed joints, the curves are offset by that amount.",
                offsets=", ".join(offsets),
            )
        )
    if any(p.zero == "walking" and p.reason is None for p in panels):
        about_zero.append(
            "No quiet standing in this trial: these curves are relative to their own mean in straight "
            "walking. Interpret shape and range only; they have no absolute level."
        )
    if any(p.zero == "anatomical" and p.reason is None for p in panels):
        about_zero.append(
            "Curves from neutral use the goniometer angles in standing as reference, like the norm."
        )
    view = estimator_view(bundle.estimator)
    notes = [
        *about_zero,
        *([view.estimated] if view is not None and view.estimated else []),
        *_interrupted(panels),
        *_norm_notes(panels),
    ]
    drawn = max((len(c.strides) for p in panels for c in p.sides.values()), default=0)
    most = max((c.n for p in panels for c in p.sides.values()), default=0)
    if most > drawn:
        notes.append(
            Message(
                "Thin lines show {DRAWN_STRIDES} strides per side, spread over the trial; means include all "
                "strides.",
                DRAWN_STRIDES=DRAWN_STRIDES,
            )
        )
    return tuple(notes)


def _interrupted(panels: Sequence[CurvePanel]) -> list[str]:
    """Curves without a value at some points."""
    broken = [
        p.variable.label
        for p in panels
        if any(c.mean_deg is not None and np.isnan(c.mean_deg).any() for c in p.sides.values())
    ]
    reason = "interrupted where the knee of the leg model is at its limit in most strides"
    return (
        [
            Message(
                "{join}: {reason}; no values there.",
                join=", ".join(broken).capitalize(),
                reason=reason,
            )
        ]
        if broken
        else []
    )


def _norm_notes(panels: Sequence[CurvePanel]) -> list[str]:
    """Notes on norms, each once for all variables concerned."""
    concerned: dict[str, list[str]] = {}
    for p in panels:
        if p.norm_note and p.reason is None:
            concerned.setdefault(p.norm_note, []).append(p.variable.label)
    return [
        f"{', '.join(labels).capitalize()}: {note[0].lower()}{note[1:]}" for note, labels in concerned.items()
    ]
