"""Outcome of feedback in a session: strides with and without it, probes, level, side effects, retention."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from sagittal.core.change.limits import Limb
from sagittal.core.events.result import Strides
from sagittal.core.feedback import AnalysedStride, FeedbackSplit, GuardState, Prescription
from sagittal.core.feedback.cue import Summary
from sagittal.core.feedback.guard import FIRST, LAST
from sagittal.core.feedback.summary import Kind
from sagittal.core.message import Message
from sagittal.core.parameters.rows import Column
from sagittal.core.plurals import plural
from sagittal.server.report.charts.feedback_chart import feedback_svg
from sagittal.server.report.files.columns import reduce_to_plain
from sagittal.server.report.view.feedback_beside import (
    PreviousTraining,
    Retention,
    SideEffectRow,
    compare_retention,
    describe_effects,
)
from sagittal.server.report.view.feedback_rows import FeedbackRow, describe_summary, format_signed
from sagittal.server.report.words.feedback_words import (
    digits_of,
    format_quantity,
    name_target,
    prescription_words,
    target_words,
)
from sagittal.server.report.words.wording import Term, format_number, parameter_term

KINDS: Final[tuple[tuple[Kind, str, bool], ...]] = (
    ("baseline", "Before feedback, first strides", False),
    ("retention", "Retention test, first strides", False),
    ("with", "With feedback", False),
    ("without", "Without feedback", False),
    ("probe", "of these, in probe blocks", True),
    ("faded", "of these, without feedback by schedule", True),
    ("off", "of these, while off, paused or without current data", True),
    ("stopped", "of these, after feedback had ended", True),
)
"""Kind of stride, its label, and whether it is part of the row above."""

_HOW_TO_READ: Final = (
    "Values are from the completed analysis; the zone is that of the level at each stride. Only strides "
    "without feedback show what is retained."
)


@dataclass(frozen=True)
class ProbeComparison:
    """A probe block and the training strides immediately before it."""

    number: int
    start_s: float
    before: FeedbackRow
    probe: FeedbackRow


@dataclass(frozen=True)
class FeedbackView:
    """Feedback section for the session page, print and API."""

    title: str
    words: tuple[tuple[str, str], ...]
    content: Prescription
    term: Term
    rows: tuple[FeedbackRow, ...]
    probes: tuple[ProbeComparison, ...]
    levels: tuple[tuple[int, float, int], ...]
    effects: tuple[SideEffectRow, ...]
    retention: Retention | None
    notes: tuple[str, ...]
    svg: str
    split: FeedbackSplit

    @property
    def target(self) -> str:
        """Mean ± sd and its source."""
        return target_words(self.content)

    @property
    def retention_words(self) -> str:
        """Difference of the first strides of this visit from the last trained ones."""
        return "" if self.retention is None else format_signed(self.retention.difference, self.term)

    def to_json(self) -> dict[str, object]:
        """JSON types with all strides."""
        plain = reduce_to_plain(
            {
                "prescription": self.content.to_json(),
                "words": [f"{label}: {text}" for label, text in self.words],
                "reason": None,
                "parameter": self.content.parameter,
                "unit": self.term.unit,
                "side": self.content.side,
                "rows": self.rows,
                "probes": self.probes,
                "levels": [{"n": n, "t_s": t, "level": level} for n, t, level in self.levels],
                "effects": self.effects,
                "retention": self.retention,
                "notes": self.notes,
                "strides": [
                    {**m.cue.to_json(), "value": m.value, "live_value": m.cue.value, "in_zone": m.inside}
                    for m in self.split.strides
                ],
            }
        )
        return plain if isinstance(plain, dict) else {}


def list_analysed_strides(strides: Strides, column: Column) -> tuple[AnalysedStride, ...]:
    """Strides with the value of the trained parameter."""
    return tuple(
        AnalysedStride(s.side, s.start_s, value, s.excluded_reason is None)
        for s, value in zip(strides.strides, column, strict=True)
    )


def feedback_view(
    content: Prescription,
    split: FeedbackSplit,
    guard: GuardState,
    previous: PreviousTraining | None = None,
    limb: Limb | None = None,
) -> FeedbackView:
    """View of the result of a trial.

    Parameters
    ----------
    previous : visit whose end is compared with the retention block. limb : of the trained side.
    """
    term = parameter_term(content.parameter)
    rows = tuple(
        describe_summary(kind, label, part, split.kinds.get(kind, Summary()), digits_of(content))
        for kind, label, part in KINDS
        if kind in {"with", "without"} or kind in split.kinds
    )
    return FeedbackView(
        title=name_target(content),
        words=tuple(prescription_words(content)),
        content=content,
        term=term,
        rows=rows,
        probes=tuple(
            ProbeComparison(
                p.number,
                p.start_s,
                describe_summary("with", "before", False, p.before, digits_of(content)),
                describe_summary("probe", "probe", False, p.probe, digits_of(content)),
            )
            for p in split.probes
        ),
        levels=tuple((s.n, s.t_s, s.level) for s in split.levels),
        effects=describe_effects(content, guard, term),
        retention=None if previous is None else compare_retention(content, split, previous, term, limb),
        notes=_notes(split, term),
        svg=feedback_svg(split, content, term) if split.strides else "",
        split=split,
    )


def _notes(split: FeedbackSplit, term: Term) -> tuple[str, ...]:
    """Explanations, and data that could not be used."""
    notes = [
        _HOW_TO_READ,
        Message(
            "Side effects: the last {LAST} strides vs the first {FIRST} of the trial.",
            LAST=LAST,
            FIRST=FIRST,
        ),
    ]
    live = split.live_difference
    if live.mean is not None and live.sd is not None:
        notes.append(
            Message(
                "Live feedback values differed from the analysis by {mean} ± {sd}.",
                mean=format_number(live.mean, term.digits + 1),
                sd=format_quantity(live.sd, term, term.digits + 1),
            )
        )
    if n := split.unmatched:
        one = "1 cue was excluded because it has no stride in the analysis."
        several = "{value} cues were excluded because they have no stride in the analysis."
        notes.append(plural(n, one, Message(several, value=n)))
    if n := split.left_out:
        one = "1 cue was excluded because its stride is excluded from the analysis."
        several = "{value} cues were excluded because their strides are excluded from the analysis."
        notes.append(plural(n, one, Message(several, value=n)))
    return tuple(notes)
