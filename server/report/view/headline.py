"""Findings of a trial and changes since the previous visit, in a few sentences.

A parameter can be compared with the norm, the other side or the previous visit. The deviation is divided by
the combined variation between subjects and measurement error; values above 1 are findings. Of related
parameters only the largest finding is reported (docs/science/headline.md). Deviations from the norm or the
other side are found by server/report/view/standouts.py.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Literal

from sagittal.core.change import Change, ChangedFact, SortedChanges, name_fact
from sagittal.core.events.result import COMPARED, Strides
from sagittal.core.frames import SIDES, Side
from sagittal.core.message import Message
from sagittal.core.parameters.catalogue import find_entry
from sagittal.core.parameters.flats import OTHER
from sagittal.core.plurals import plural
from sagittal.server.report.view.level import from_standing
from sagittal.server.report.words.change_words import change_words, find_term
from sagittal.server.report.words.headline_phrases import (
    BOTH_LONGER,
    BOTH_SHORTER,
    CHANGED_DOWN,
    CHANGED_UP,
    PHRASES,
    TRIAL_CHANGED_DOWN,
    TRIAL_CHANGED_UP,
    Family,
)
from sagittal.server.report.words.wording import format_number, parameter_term

Kind = Literal["norm", "limit", "sides", "change"]

LARGEST: Final = 5.0
"""Sizes are capped here, so that absurd values do not come first."""

MOST: Final = 6
"""Maximum number of sentences on the page, including changes."""

KEPT: Final = 2
"""Of these reserved for changes, which may also use free space."""


@dataclass(frozen=True)
class HeadlineSentence:
    """One sentence: `before`, then in bold `strong`, then `after`.

    Parameters
    ----------
    name : underlying parameter. side : leg concerned, None = both or none.
    kind : type of comparison. size : deviation relative to normal variation.
    against : reference group, in words. relevant : the change is clinically relevant.
    """

    name: str
    side: Side | None
    family: Family
    kind: Kind
    size: float
    before: str
    strong: str
    after: str
    against: str
    relevant: bool = False

    @property
    def marked(self) -> str:
        """The sentence with its bold part between asterisks."""
        return f"{self.before}*{self.strong}*{self.after}"

    @property
    def text(self) -> str:
        """The sentence as plain text."""
        return f"{self.before}{self.strong}{self.after}"


@dataclass(frozen=True)
class ChangeLeft:
    """A real change omitted for lack of space: parameter, difference, and assessment in words."""

    title: str
    side: Side | None
    size: str
    verdict: str


@dataclass(frozen=True)
class Headline:
    """Summary of findings and changes.

    Parameters
    ----------
    badge : number of included strides, in one sentence; empty for poor data.
    stands_out, changed : all sentences, largest first. looked_at : number of parameters considered.
    changes : all changes since the previous visit, by assessment.
    """

    badge: str
    stands_out: tuple[HeadlineSentence, ...] = ()
    changed: tuple[HeadlineSentence, ...] = ()
    looked_at: int = 0
    changes: SortedChanges = field(default_factory=SortedChanges)

    @property
    def shown_changes(self) -> tuple[HeadlineSentence, ...]:
        """Changes that fit."""
        return self.changed[: max(KEPT, MOST - len(self.stands_out))]

    @property
    def shown(self) -> tuple[HeadlineSentence, ...]:
        """Findings that fit."""
        return self.stands_out[: MOST - len(self.shown_changes)]

    @property
    def compared_with(self) -> str:
        """Reference groups of the displayed sentences; empty without any."""
        *groups, last = dict.fromkeys(s.against for s in self.shown) or ("",)
        groups_text = Message("{groups} and {last}", groups=", ".join(groups), last=last) if groups else last
        return Message("vs {groups_text}", groups_text=groups_text) if groups_text else ""

    @property
    def ranks(self) -> dict[str, int]:
        """Rank of sentences by parameter name, printed in the row of that parameter."""
        return {s.name: rank for rank, s in enumerate(self.shown, 1)}

    @property
    def curve_ranks(self) -> dict[str, tuple[int, ...]]:
        """Ranks of sentences about cycle curves, by variable, printed with the chart."""
        ranks: dict[str, tuple[int, ...]] = {}
        for name, rank in self.ranks.items():
            entry = find_entry(from_standing(name) or name)
            if entry is not None and entry.curve is not None:
                ranks[entry.curve.variable] = (*ranks.get(entry.curve.variable, ()), rank)
        return ranks

    @property
    def standouts_left(self) -> tuple[str, ...]:
        """Labels of findings that do not fit."""
        left = self.stands_out[len(self.shown) :]
        return tuple(dict.fromkeys(parameter_term(from_standing(s.name) or s.name).label for s in left))

    @property
    def changes_left(self) -> tuple[ChangeLeft, ...]:
        """Real changes not covered by a displayed sentence."""
        return tuple(
            ChangeLeft(
                find_term(c.name, c.unit).label,
                name_fact(c.name, c.side)[1] and c.side,
                words.size,
                words.verdict,
            )
            for fact in self.changes.real
            if not any(_tells(s, fact) for s in self.shown_changes)
            for c, words in ((fact.change, change_words(fact.change)),)
        )


def _tells(sentence: HeadlineSentence, fact: ChangedFact) -> bool:
    """Whether a sentence covers a change; a sentence without a side covers both."""
    return any(
        sentence.name == c.name
        and (sentence.side is None or name_fact(c.name, sentence.side) == name_fact(c.name, c.side))
        for c in (fact.change, *fact.same)
    )


def say_badge(kind: str, strides: Strides) -> str:
    """Number of included strides, in one sentence; empty for poor data.

    Parameters
    ----------
    kind : overall data quality, ok, warn or bad.
    """
    if kind == "bad":
        return ""
    left, right = (len(strides.select_used(side)) for side in SIDES)
    count = left + right
    count_text = Message(
        f"{{count}} {plural(count, 'stride', 'strides')} included, {{left}} left and {{right}} right",
        count=count,
        left=left,
        right=right,
    )
    if min(left, right) < COMPARED and strides.strides:
        return Message(
            "{count_text}: at least {COMPARED} per side are needed for a comparison.",
            count_text=count_text,
            COMPARED=COMPARED,
        )
    if not strides.strides:
        return "Steps are from the trunk sensor; sides are not compared."
    return f"{count_text}."


def find_changes(changes: SortedChanges) -> tuple[HeadlineSentence, ...]:
    """Sentences about real changes: clinically relevant ones first, then the largest."""
    real: dict[str, list[tuple[Change, float]]] = {}
    relevant: set[str] = set()
    for fact in changes.real:
        c = next((c for c in (fact.change, *fact.same) if c.name in PHRASES), None)
        if c is not None and c.difference is not None and c.limit:
            real.setdefault(c.name, []).append((c, min(abs(c.difference) / c.limit, LARGEST)))
            relevant |= {c.name} if fact.relevant else set()
    sentences = [s for group in real.values() for s in _of_change(group)]
    return take_largest([replace(s, relevant=s.name in relevant) for s in sentences])


def take_largest(sentences: Sequence[HeadlineSentence]) -> tuple[HeadlineSentence, ...]:
    """The most important sentence of each family: relevant ones first, then the largest."""
    order = {name: i for i, name in enumerate(PHRASES)}

    def place(s: HeadlineSentence) -> tuple[bool, float, int]:
        return not s.relevant, -s.size, order.get(from_standing(s.name) or s.name, len(order))

    ranked = sorted(sentences, key=place)
    largest: dict[str, HeadlineSentence] = {}
    for s in ranked:
        largest.setdefault(s.family, s)
    return tuple(largest.values())


def _of_change(group: Sequence[tuple[Change, float]]) -> Iterator[HeadlineSentence]:
    """One sentence for the sides of a parameter that changed."""
    worst, size = max(group, key=lambda pair: pair[1])
    p, change = PHRASES[worst.name], worst.difference or 0.0
    sides = {c.side: c.difference or 0.0 for c, _ in group}
    if worst.name == "step_length_m" and set(sides) == set(SIDES) and sides["left"] * sides["right"] > 0.0:
        digits = parameter_term(worst.name).digits
        lengths = {side[0]: format_number(abs(sides[side]), digits) for side in SIDES}
        both = BOTH_LONGER if change > 0 else BOTH_SHORTER
        yield make_sentence(worst.name, p.family, "change", size, both, lengths, None)
        return
    words = {
        "noun": p.noun,
        "d": format_amount(worst.name, abs(change)),
        "before": format_amount(worst.name, p.sign * (worst.before or 0.0)),
        "after": format_amount(worst.name, p.sign * (worst.after or 0.0)),
    }
    patterns = (TRIAL_CHANGED_DOWN, TRIAL_CHANGED_UP) if worst.side is None else (CHANGED_DOWN, CHANGED_UP)
    pattern = patterns[p.sign * change > 0.0]
    yield make_sentence(worst.name, p.family, "change", size, pattern, words, worst.side)


def make_sentence(
    name: str,
    family: Family,
    kind: Kind,
    size: float,
    pattern: str,
    words: Mapping[str, str],
    side: Side | None,
    people: str = "",
) -> HeadlineSentence:
    """Create a sentence from a pattern with its bold part between asterisks; sizes are capped at LARGEST."""
    against = people or {"sides": "the other side", "limit": "limits"}.get(kind, "")
    legs = {} if side is None else {"side": side, "other": OTHER[side]}
    head, strong, tail = pattern.format(**words, **legs).split("*")
    return HeadlineSentence(name, side, family, kind, min(size, LARGEST), head, strong, tail, against)


def choose_digits(name: str) -> int:
    """Decimals: none for degrees and steps/min, one for percentages, two for metres and seconds."""
    term = parameter_term(name)
    return {"°": 0, "steps/min": 0, "%": 1}.get(term.unit, 2)


def format_amount(name: str, value: float, *, unit: bool = True) -> str:
    """Format a value with its unit as findings print it; circumduction is in centimetres.

    >>> format_amount("knee_flexion_rom_deg", -3.6), format_amount("circumduction_m", 0.124)
    ('−4°', '12\u202fcm')
    """
    printed = parameter_term(from_standing(name) or name).unit
    if name == "circumduction_m":
        text, printed = format_number(100.0 * value, 0), "cm"
    else:
        text = format_number(value, choose_digits(from_standing(name) or name))
    return text if not unit else f"{text}°" if printed == "°" else f"{text}\u202f{printed}"
