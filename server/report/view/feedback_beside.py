"""Side effects of feedback during a trial, and retention since the last training."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.change import find_detectable_change
from sagittal.core.change.limits import Limb
from sagittal.core.feedback import (
    AnalysedStride,
    Baseline,
    FeedbackSplit,
    GuardState,
    Prescription,
    SideEffect,
)
from sagittal.core.feedback.guard import FIRST, GuardWatch
from sagittal.core.message import Message
from sagittal.core.parameters.result import CycleCurves
from sagittal.server.report.view.feedback_rows import NO_STRIDES, FeedbackRow, describe_summary, format_signed
from sagittal.server.report.words.feedback_words import digits_of, format_quantity
from sagittal.server.report.words.wording import Term

EFFECT_REASONS: Final = {
    "too_few_strides": Message(
        "requires {FIRST} strides at the start and {FIRST2} afterwards on this side",
        FIRST=FIRST,
        FIRST2=FIRST,
    ),
    "joint_missing": "requires joint angles of both legs",
    "both_sides_trained": "both sides are trained",
    "no_limit": "no limit prescribed",
}


@dataclass(frozen=True)
class SideEffectRow:
    """A side effect; `kind` is ok, warn, or none if it cannot be assessed."""

    name: str
    label: str
    kind: str
    change: float | None
    limit: float | None
    source: str | None
    text: str
    words: str


@dataclass(frozen=True)
class Retention:
    """First strides of this visit compared with the last training strides of the previous one.

    Parameters
    ----------
    verdict : in words, with the underlying limit.
    """

    session_id: str
    performed_on: dt.date
    end: FeedbackRow
    now: FeedbackRow
    difference: float
    limit: float | None
    limit_source: str | None
    verdict: str


@dataclass(frozen=True)
class PreviousTraining:
    """The previous visit with the same training."""

    session_id: str
    performed_on: dt.date
    split: FeedbackSplit


def side_effects(
    content: Prescription, baseline: Baseline, strides: Sequence[AnalysedStride], curves: CycleCurves | None
) -> GuardState:
    """Side effects during the trial, from the rules of the live guard applied to the analysed strides."""
    watch = GuardWatch(content, baseline)
    rows = {} if curves is None else {
        (side, i): k for side, index in curves.stride_index.items() for k, i in enumerate(index)
    }  # fmt: skip
    for i in sorted(range(len(strides)), key=lambda i: strides[i].start_s):
        s = strides[i]
        if not s.counted or s.value is None:
            continue
        values = {}
        if curves is not None:
            for variable, sides in curves.curves.items():
                row = sides[s.side][rows[s.side, i]] if s.side in sides else None
                if row is not None and np.isfinite(row).all():
                    values[variable] = row
        watch.add_stride(s.side, s.value, values)
    return watch.state


def describe_effects(content: Prescription, guard: GuardState, term: Term) -> tuple[SideEffectRow, ...]:
    """Side effects on the other side and the sagittal profile, in words."""
    opposite = "other side" if content.side is None else "right" if content.side == "left" else "left"
    gps = Term("Sagittal profile score", "°", "", 1, (0, 20), ("larger", "smaller"))
    return (
        _effect("other_side", f"{term.label}, {opposite}", guard.other, term),
        _effect("gps_sagittal_deg", "Sagittal profile score, both sides", guard.gps, gps),
    )


def _effect(name: str, label: str, effect: SideEffect, term: Term) -> SideEffectRow:
    if effect.change is None:
        explanation = EFFECT_REASONS.get(effect.reason or "", effect.reason or "")
        return SideEffectRow(
            name,
            label,
            "none",
            None,
            None,
            None,
            NO_STRIDES,
            Message("not assessed: {explanation}", explanation=explanation),
        )
    text = format_signed(effect.change, term)
    if effect.limit is None:
        return SideEffectRow(
            name, label, "none", effect.change, None, None, text, EFFECT_REASONS[effect.reason or "no_limit"]
        )
    limit = f"{format_quantity(effect.limit, term, max(term.digits, 1))} ({effect.source})"
    words = (
        Message("more than {limit}", limit=limit) if effect.beyond else Message("within {limit}", limit=limit)
    )
    kind = "warn" if effect.beyond else "ok"
    return SideEffectRow(name, label, kind, effect.change, effect.limit, effect.source, text, words)


def compare_retention(
    content: Prescription, split: FeedbackSplit, previous: PreviousTraining, term: Term, limb: Limb | None
) -> Retention | None:
    """Compare the retention block with the end of the previous training; None if either is missing."""
    now, end = split.kinds.get("retention"), previous.split.end
    if now is None or now.mean is None or end.mean is None:
        return None
    difference = now.mean - end.mean
    limit = find_detectable_change(content.parameter, end.mean, limb)
    if limit is None:
        verdict = "the measurement error of this parameter is unknown"
    elif abs(difference) <= limit.value:
        verdict = Message(
            "within the measurement error of {value}",
            value=format_quantity(limit.value, term, term.digits + 1),
        )
    else:
        verdict = Message(
            "more than the measurement error of {value}",
            value=format_quantity(limit.value, term, term.digits + 1),
        )
    return Retention(
        previous.session_id,
        previous.performed_on,
        describe_summary("end", "End of the last training", False, end, digits_of(content)),
        describe_summary(
            "retention", "Start of this visit, without feedback", False, now, digits_of(content)
        ),
        difference,
        None if limit is None else limit.value,
        None if limit is None else limit.source,
        verdict,
    )
