"""What stands out in a take and what changed since the visit before, in a few sentences.

Every figure may speak by its distance from the norm, from the other side or from the visit before. Its size
says how far beyond what people and measurement vary by: a figure speaks when that is above 1. Of the figures
that tell the same thing the largest speaks (docs/science/headline.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import hypot
from typing import Final, Literal

from sagittal.core.change import Change, ChangedFact, SortedChanges, name_fact
from sagittal.core.events.result import COMPARED, Strides
from sagittal.core.flags import Flag
from sagittal.core.frames import SIDES, Side
from sagittal.core.norms.lookup import Norms
from sagittal.core.parameters.catalogue import find_entry
from sagittal.core.parameters.flats import OTHER
from sagittal.core.parameters.variability import NORMAL_95
from sagittal.core.plurals import plural
from sagittal.server.report.view.level import from_standing
from sagittal.server.report.view.table import BEYOND_SD, ParameterRow, TableCell
from sagittal.server.report.words.change_words import change_words, find_term
from sagittal.server.report.words.headline_phrases import (
    BOTH_STEPS,
    PELVIS_RISES,
    PHRASES,
    SHORT_AND_QUICK,
    Family,
    Phrases,
)
from sagittal.server.report.words.wording import format_number, parameter_term, round_difference

Kind = Literal["norm", "limit", "sides", "change"]

NEARLY: Final = 0.8
"""A difference of the sides is told before one from the norm unless that is larger by more than this."""

LARGEST: Final = 5.0
"""Sizes are cut here: what is further off is not told first for being absurd."""

AT_SPEED: Final = "people at this speed"

MOST: Final = 6
"""Sentences on the page, changes among them."""

KEPT: Final = 2
"""Of them for changes, however much stands out; they also take what it leaves free."""


@dataclass(frozen=True)
class HeadlineSentence:
    """One sentence: `before`, then in bold `strong`, then `after`.

    Parameters
    ----------
    name : parameter that proves it. side : leg spoken of, None = both or none.
    kind : what the figure was held against. size : how often it is beyond what varies by itself.
    against : whom the figure was held against, in words. relevant : a change that is clinically relevant.
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
        """The sentence without its bold part marked."""
        return f"{self.before}{self.strong}{self.after}"


@dataclass(frozen=True)
class ChangeLeft:
    """A real change that no sentence had room for: its figure, by how much, and the verdict in words."""

    title: str
    side: Side | None
    size: str
    verdict: str


@dataclass(frozen=True)
class Headline:
    """What a person reads first.

    Parameters
    ----------
    badge : how many strides count, in one sentence; empty for poor data.
    stands_out, changed : all sentences, largest first. looked_at : figures that could have spoken.
    changes : every change since the visit before, by its verdict.
    """

    badge: str
    stands_out: tuple[HeadlineSentence, ...] = ()
    changed: tuple[HeadlineSentence, ...] = ()
    looked_at: int = 0
    changes: SortedChanges = field(default_factory=SortedChanges)

    @property
    def shown_changes(self) -> tuple[HeadlineSentence, ...]:
        """Changes that have room."""
        return self.changed[: max(KEPT, MOST - len(self.stands_out))]

    @property
    def shown(self) -> tuple[HeadlineSentence, ...]:
        """What stands out, as far as there is room."""
        return self.stands_out[: MOST - len(self.shown_changes)]

    @property
    def compared_with(self) -> str:
        """Whom the sentences shown hold the figures against; empty without a sentence."""
        *before, last = dict.fromkeys(s.against for s in self.shown) or ("",)
        said = f"{', '.join(before)} and {last}" if before else last
        return f"against {said}" if said else ""

    @property
    def ranks(self) -> dict[str, int]:
        """Rank of the sentence by the name of its figure; printed at the row of that name."""
        return {s.name: rank for rank, s in enumerate(self.shown, 1)}

    @property
    def curve_ranks(self) -> dict[str, tuple[int, ...]]:
        """Ranks of the sentences about figures of a cycle curve, by its variable; printed at its chart."""
        ranks: dict[str, tuple[int, ...]] = {}
        for name, rank in self.ranks.items():
            entry = find_entry(from_standing(name) or name)
            if entry is not None and entry.curve is not None:
                ranks[entry.curve.variable] = (*ranks.get(entry.curve.variable, ()), rank)
        return ranks

    @property
    def standouts_left(self) -> tuple[str, ...]:
        """Labels of what stands out and has no room."""
        left = self.stands_out[len(self.shown) :]
        return tuple(dict.fromkeys(parameter_term(from_standing(s.name) or s.name).label for s in left))

    @property
    def changes_left(self) -> tuple[ChangeLeft, ...]:
        """Real changes that no sentence shown tells."""
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
    """Whether a sentence says a changed fact; one without a side speaks of both."""
    return any(
        sentence.name == c.name
        and (sentence.side is None or name_fact(c.name, sentence.side) == name_fact(c.name, c.side))
        for c in (fact.change, *fact.same)
    )


def say_badge(kind: str, strides: Strides) -> str:
    """How many strides count, in one sentence; empty for data that are not good enough to count them.

    Parameters
    ----------
    kind : ok, warn or bad, of the data as a whole.
    """
    if kind == "bad":
        return ""
    left, right = (len(strides.select_used(side)) for side in SIDES)
    count = left + right
    counted = f"{count} {plural(count, 'stride', 'strides')} used, {left} left and {right} right"
    if min(left, right) < COMPARED and strides.strides:
        return f"{counted}: fewer than {COMPARED} of a side are compared with nobody."
    if not strides.strides:
        return "Steps are told by the trunk; sides are not compared."
    return f"{counted}."


def find_standouts(
    rows: Sequence[ParameterRow], norms: Norms, flags: Sequence[Flag] = ()
) -> tuple[tuple[HeadlineSentence, ...], int]:
    """Figures beyond the norm, a limit or the other side, largest first, and how many could have been.

    Parameters
    ----------
    rows : of the parameter table, every angle from the zero of its curve (`level.choose_zero`).
    norms : they were held against.
    flags : values against limits.
    """
    told = [row for row in rows if _phrases(row.name) is not None and not row.low_confidence]
    found = [s for row in told for s in _of_row(row, norms)]
    found = _join_steps(found, {row.name: row for row in told})
    found += _of_flags(flags)
    looked_at = sum(
        any(c is not None and c.z is not None for c in (row.both, row.left, row.right))
        or row.symmetry is not None
        for row in told
    )
    return _largest_of_families(found), looked_at


def find_changes(changes: SortedChanges) -> tuple[HeadlineSentence, ...]:
    """Sentences on the real changes: what is clinically relevant first, then the largest."""
    real: dict[str, list[tuple[Change, float]]] = {}
    relevant: set[str] = set()
    for fact in changes.real:
        c = next((c for c in (fact.change, *fact.same) if c.name in PHRASES), None)
        if c is not None and c.difference is not None and c.limit:
            real.setdefault(c.name, []).append((c, min(abs(c.difference) / c.limit, LARGEST)))
            relevant |= {c.name} if fact.relevant else set()
    found = [s for group in real.values() for s in _of_change(group)]
    return _largest_of_families([replace(s, relevant=s.name in relevant) for s in found])


def _largest_of_families(found: Sequence[HeadlineSentence]) -> tuple[HeadlineSentence, ...]:
    order = {name: i for i, name in enumerate(PHRASES)}

    def place(s: HeadlineSentence) -> tuple[bool, float, int]:
        return not s.relevant, -s.size, order.get(from_standing(s.name) or s.name, len(order))

    ranked = sorted(found, key=place)
    largest: dict[str, HeadlineSentence] = {}
    for s in ranked:
        largest.setdefault(s.family, s)
    return tuple(largest.values())


def _phrases(name: str) -> Phrases | None:
    return PHRASES.get(from_standing(name) or name)


def _of_row(row: ParameterRow, norms: Norms) -> Iterator[HeadlineSentence]:
    """At most one sentence: whichever comparison says most of the figure."""
    p = _phrases(row.name)
    if p is None:
        return
    if row.both is not None:
        z = _certain_z(row, row.both)
        if z is not None and abs(z) > BEYOND_SD:
            yield from _against_norm(row, p.both_low if z < 0 else p.both_high, None, abs(z), p)
        return
    z_of = {side: z for side in SIDES if (z := _certain_z(row, _cell(row, side))) is not None}
    apart = _of_sides(row, p, norms)
    if len(z_of) == len(SIDES) and (apart is None or apart.size <= 1.0):
        # sides that cannot be told apart speak together
        mean = sum(z_of.values()) / len(SIDES)
        if abs(mean) > BEYOND_SD:
            yield from _against_norm(row, p.both_low if mean < 0 else p.both_high, None, abs(mean), p)
        return
    far = {side: z for side, z in z_of.items() if abs(z) > BEYOND_SD}
    size = max((abs(z) for z in far.values()), default=0.0) / BEYOND_SD
    if apart is not None and apart.size > 1.0 and apart.size >= NEARLY * min(size, LARGEST):
        yield apart
    elif far:
        side: Side = max(far, key=lambda s: abs(far[s]))
        yield from _against_norm(row, p.side_low if far[side] < 0 else p.side_high, side, abs(far[side]), p)


def _certain_z(row: ParameterRow, cell: TableCell | None) -> float | None:
    """Deviations from the norm's mean, of people and of the measurement together; None without a norm."""
    if cell is None or cell.z is None or row.norm_sd is None:
        return None
    measured = 0.0 if cell.uncertainty is None else cell.uncertainty / NORMAL_95
    return cell.z * row.norm_sd / hypot(row.norm_sd, measured)


def _against_norm(
    row: ParameterRow, pattern: str, side: Side | None, z: float, p: Phrases
) -> Iterator[HeadlineSentence]:
    if not pattern or row.norm_mean is None or row.norm_sd is None:
        return
    words = {
        "a": _number(row, row.norm_mean - row.norm_sd),
        "b": _number(row, row.norm_mean + row.norm_sd),
        **{key: _number(row, c.value) for key, c in (("l", row.left), ("r", row.right)) if c is not None},
    }
    spoken = row.both if row.both is not None else _cell(row, side)
    if spoken is not None:
        words["v"] = _number(row, spoken.value)
    yield _sentence(row.name, p.family, "norm", z / BEYOND_SD, pattern, words, side, _people(row, p.family))


def _people(row: ParameterRow, family: Family) -> str:
    """Of whom a norm is: speed itself cannot be held against people at this speed."""
    if family == "speed":
        return "people of this age"
    return AT_SPEED if family == "step" or row.comfortable is not None else "healthy people"


def _of_sides(row: ParameterRow, p: Phrases, norms: Norms) -> HeadlineSentence | None:
    """The sides against each other, of the one further from its norm.

    None where strides and measurement leave open which is larger, and where both are within the norm.
    """
    s = row.symmetry
    if s is None or not s.clear or s.low is None or s.high is None or not (p.smaller or p.larger):
        return None
    if row.left is None or row.right is None:
        return None
    name = from_standing(row.name) or row.name
    norm = norms.values.get(name) or norms.comfortable.get(name)
    healthy = BEYOND_SD * norm.difference_sd if norm is not None and norm.difference_sd else 0.0
    share = p.apart * 0.5 * (abs(row.left.value) + abs(row.right.value))
    size = abs(s.difference) / max(0.5 * (s.high - s.low), healthy, share, p.least)
    larger: Side = s.first if s.difference > 0.0 else OTHER[s.first]
    side = _side_off_norm(row) if _has_norm(row) else larger if p.names_larger else OTHER[larger]
    if side is None:
        return None
    apart = round_difference(row.left.value, row.right.value, parameter_term(name))
    words = {"d": _number(row, apart), "cm": format_number(100.0 * apart, 0)}
    return _sentence(
        row.name, p.family, "sides", size, p.larger if side == larger else p.smaller, words, side
    )


def _has_norm(row: ParameterRow) -> bool:
    return any(c is not None and c.z is not None for c in (row.left, row.right))


def _side_off_norm(row: ParameterRow) -> Side | None:
    """The side further from its norm; None where both are within it, as their row shows them.

    The uncertainty of a level is mostly common to both sides (the definition of a contact); whether the sides
    differ is judged by the interval of their difference.
    """
    z = {side: c.z for side in SIDES if (c := _cell(row, side)) is not None and c.z is not None}
    furthest = max(z, key=lambda side: abs(z[side]))
    return furthest if abs(z[furthest]) > BEYOND_SD else None


def _join_steps(found: list[HeadlineSentence], rows: Mapping[str, ParameterRow]) -> list[HeadlineSentence]:
    """Short steps and a quick cadence are one sentence."""
    steps, cadence = rows.get("step_length_m"), rows.get("cadence_spm")
    if steps is None or cadence is None or cadence.both is None or steps.norm_mean is None:
        return found
    z = [z for c in (steps.left, steps.right) if (z := _certain_z(steps, c)) is not None]
    quick = _certain_z(cadence, cadence.both)
    if len(z) < len(SIDES) or max(z) >= -BEYOND_SD or quick is None or quick <= BEYOND_SD:
        return found
    low, high = steps.norm_mean - (steps.norm_sd or 0.0), steps.norm_mean + (steps.norm_sd or 0.0)
    mean = sum(c.value for c in (steps.left, steps.right) if c is not None) / len(SIDES)
    words = {
        "l": _number(steps, mean),
        "c": _number(cadence, cadence.both.value),
        "a": _number(steps, low),
        "b": _number(steps, high),
    }
    size = max(-min(z), quick) / BEYOND_SD
    others = [s for s in found if s.name not in ("step_length_m", "cadence_spm")]
    told = _sentence("step_length_m", "step", "norm", size, SHORT_AND_QUICK, words, None, AT_SPEED)
    return [*others, told]


def _of_flags(flags: Sequence[Flag]) -> list[HeadlineSentence]:
    """What only a limit judges: the pelvis that a side lifts in swing."""
    return [
        _sentence(
            f.measure,
            "trunk",
            "limit",
            1.0 + (f.value - f.limit) / f.spread,
            PELVIS_RISES,
            {"v": format_number(f.value, 0), "b": format_number(f.limit, 0)},
            f.side,
        )
        for f in flags
        if f.name == "hip_hiking" and f.exceeded and f.certain and f.verified
        if f.value is not None and f.limit is not None and f.spread is not None and f.side is not None
    ]


def _of_change(group: Sequence[tuple[Change, float]]) -> Iterator[HeadlineSentence]:
    """One sentence of the sides of a figure that changed."""
    worst, size = max(group, key=lambda pair: pair[1])
    p, by = PHRASES[worst.name], worst.difference or 0.0
    sides = {c.side: c.difference or 0.0 for c, _ in group}
    if worst.name == "step_length_m" and set(sides) == set(SIDES) and sides["left"] * sides["right"] > 0.0:
        digits = parameter_term(worst.name).digits
        words = {
            "word": "longer" if by > 0 else "shorter",
            "l": format_number(abs(sides["left"]), digits),
            "r": format_number(abs(sides["right"]), digits),
        }
        yield _sentence(worst.name, p.family, "change", size, BOTH_STEPS, words, None)
        return
    pattern = p.up if by > 0 else p.down
    if pattern:
        words = {
            "d": format_number(abs(by), _digits(worst.name)),
            "cm": format_number(100.0 * abs(by), 0),
        }
        yield _sentence(worst.name, p.family, "change", size, pattern, words, worst.side)


def _sentence(
    name: str,
    family: Family,
    kind: Kind,
    size: float,
    pattern: str,
    words: Mapping[str, str],
    side: Side | None,
    people: str = "",
) -> HeadlineSentence:
    against = people or {"sides": "the other side", "limit": "limits"}.get(kind, "")
    legs = {} if side is None else {"side": side, "other": OTHER[side]}
    before, strong, after = pattern.format(**words, **legs).split("*")
    return HeadlineSentence(name, side, family, kind, min(size, LARGEST), before, strong, after, against)


def _cell(row: ParameterRow, side: Side | None) -> TableCell | None:
    return {"left": row.left, "right": row.right}[side] if side is not None else None


def _number(row: ParameterRow, value: float) -> str:
    return format_number(value, _digits(from_standing(row.name) or row.name))


def _digits(name: str) -> int:
    """Degrees and steps a minute whole, shares to a tenth, metres and seconds to a hundredth."""
    term = parameter_term(name)
    return {"°": 0, "steps/min": 0, "%": 1}.get(term.unit, 2)
