"""Findings of a trial: parameters compared with norm, limit or other side, one sentence each.

For the selection of sentences see server/report/view/headline.py.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import hypot
from typing import Final

from sagittal.core.flags import Flag
from sagittal.core.frames import SIDES, Side
from sagittal.core.norms.lookup import Norms
from sagittal.core.parameters.flats import OTHER
from sagittal.core.parameters.variability import NORMAL_95
from sagittal.server.report.view.headline import (
    LARGEST,
    HeadlineSentence,
    format_amount,
    make_sentence,
    take_largest,
)
from sagittal.server.report.view.level import from_standing
from sagittal.server.report.view.table import BEYOND_SD, ParameterRow, TableCell
from sagittal.server.report.words.headline_phrases import (
    NORM,
    OF_BOTH,
    OF_SIDE,
    OF_SIDES,
    OF_TRIAL,
    PELVIS_RISES,
    PHRASES,
    SHORT_AND_QUICK,
    Family,
    Phrases,
)
from sagittal.server.report.words.wording import format_number, parameter_term, round_difference

NEARLY: Final = 0.8
"""A side difference takes precedence over a deviation from the norm from this fraction of its size on."""

AT_SPEED: Final = "people at this speed"


def find_standouts(
    rows: Sequence[ParameterRow], norms: Norms, flags: Sequence[Flag] = ()
) -> tuple[tuple[HeadlineSentence, ...], int]:
    """Findings against norm, limits or the other side, largest first, and the number considered.

    Parameters
    ----------
    rows : of the parameter table, every angle with the zero of its curve (`level.choose_zero`).
    norms : used for the comparison.
    flags : values against limits.
    """
    candidates = [row for row in rows if _phrases(row.name) is not None and not row.low_confidence]
    sentences = [s for row in candidates for s in _of_row(row, norms)]
    sentences = _join_steps(sentences, {row.name: row for row in candidates})
    sentences += _of_flags(flags)
    looked_at = sum(
        any(c is not None and c.z is not None for c in (row.both, row.left, row.right))
        or row.symmetry is not None
        for row in candidates
    )
    return take_largest(sentences), looked_at


def _phrases(name: str) -> Phrases | None:
    return PHRASES.get(from_standing(name) or name)


def _of_row(row: ParameterRow, norms: Norms) -> Iterator[HeadlineSentence]:
    """At most one sentence: that of the comparison with the largest deviation."""
    p = _phrases(row.name)
    if p is None:
        return
    if row.both is not None:
        z = _certain_z(row, row.both)
        if z is not None and abs(z) > BEYOND_SD:
            yield from _against_norm(row, p, OF_TRIAL, z)
        return
    z_of = {side: z for side in SIDES if (z := _certain_z(row, _cell(row, side))) is not None}
    apart = _of_sides(row, p, norms)
    if len(z_of) == len(SIDES) and (apart is None or apart.size <= 1.0):
        # sides without a clear difference are reported together
        mean = sum(z_of.values()) / len(SIDES)
        if abs(mean) > BEYOND_SD:
            yield from _against_norm(row, p, OF_BOTH, mean)
        return
    far = {side: z for side, z in z_of.items() if abs(z) > BEYOND_SD}
    size = max((abs(z) for z in far.values()), default=0.0) / BEYOND_SD
    if apart is not None and apart.size > 1.0 and apart.size >= NEARLY * min(size, LARGEST):
        yield apart
    elif far:
        side: Side = max(far, key=lambda s: abs(far[s]))
        yield from _against_norm(row, p, OF_SIDE, far[side], side)


def _certain_z(row: ParameterRow, cell: TableCell | None) -> float | None:
    """z-score that includes measurement uncertainty; None without a norm."""
    if cell is None or cell.z is None or row.norm_sd is None:
        return None
    measured = 0.0 if cell.uncertainty is None else cell.uncertainty / NORMAL_95
    return cell.z * row.norm_sd / hypot(row.norm_sd, measured)


def _against_norm(
    row: ParameterRow, p: Phrases, pattern: str, z: float, side: Side | None = None
) -> Iterator[HeadlineSentence]:
    word = p.low if p.sign * z < 0.0 else p.high
    if not word:
        return
    cells = {"l": row.left, "r": row.right, "v": row.both if row.both is not None else _cell(row, side)}
    words = {
        "noun": p.noun,
        "word": word,
        "norm": _norm_words(row, p),
        **{key: _number(row, p.sign * c.value) for key, c in cells.items() if c is not None},
    }
    people = _people(row, p.family)
    yield make_sentence(row.name, p.family, "norm", abs(z) / BEYOND_SD, pattern, words, side, people)


def _norm_words(row: ParameterRow, p: Phrases) -> str:
    if row.norm_mean is None or row.norm_sd is None:
        return ""
    mean = format_amount(row.name, p.sign * row.norm_mean, unit=False)
    return NORM.format(mean=mean, sd=format_amount(row.name, row.norm_sd))


def _people(row: ParameterRow, family: Family) -> str:
    """Reference group of a norm; gait speed itself cannot be compared at matched speed."""
    if family == "speed":
        return "people of this age"
    return AT_SPEED if family == "step" or row.comfortable is not None else "healthy people"


def _of_sides(row: ParameterRow, p: Phrases, norms: Norms) -> HeadlineSentence | None:
    """Comparison of the sides, naming the one further from its norm.

    None if the larger side is uncertain given strides and measurement error, or if both are within the norm.
    """
    s = row.symmetry
    if s is None or not s.clear or s.low is None or s.high is None or not (p.less or p.more):
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
    own, opposite = (row.left, row.right) if side == "left" else (row.right, row.left)
    words = {
        "noun": p.noun,
        "word": p.more if (side == larger) == (p.sign > 0) else p.less,
        "d": _number(row, apart),
        "v": _number(row, p.sign * own.value),
        "o": _number(row, p.sign * opposite.value),
        "norm": _norm_words(row, p),
    }
    return make_sentence(row.name, p.family, "sides", size, OF_SIDES, words, side)


def _has_norm(row: ParameterRow) -> bool:
    return any(c is not None and c.z is not None for c in (row.left, row.right))


def _side_off_norm(row: ParameterRow) -> Side | None:
    """The side further from the norm; None if both are within it, as their row indicates.

    The uncertainty of an absolute value is mostly common to both sides (the definition of a contact); whether
    the sides differ is determined by the confidence interval of their difference.
    """
    z = {side: c.z for side in SIDES if (c := _cell(row, side)) is not None and c.z is not None}
    furthest = max(z, key=lambda side: abs(z[side]))
    return furthest if abs(z[furthest]) > BEYOND_SD else None


def _join_steps(
    sentences: list[HeadlineSentence], rows: Mapping[str, ParameterRow]
) -> list[HeadlineSentence]:
    """Combine short steps and high cadence into one sentence."""
    steps, cadence = rows.get("step_length_m"), rows.get("cadence_spm")
    if steps is None or cadence is None or cadence.both is None or steps.norm_mean is None:
        return sentences
    z = [z for c in (steps.left, steps.right) if (z := _certain_z(steps, c)) is not None]
    quick = _certain_z(cadence, cadence.both)
    if len(z) < len(SIDES) or max(z) >= -BEYOND_SD or quick is None or quick <= BEYOND_SD:
        return sentences
    mean = sum(c.value for c in (steps.left, steps.right) if c is not None) / len(SIDES)
    words = {
        "l": format_amount(steps.name, mean),
        "c": format_amount(cadence.name, cadence.both.value),
        "norm": _norm_words(steps, PHRASES["step_length_m"]),
    }
    size = max(-min(z), quick) / BEYOND_SD
    remaining = [s for s in sentences if s.name not in ("step_length_m", "cadence_spm")]
    sentence = make_sentence("step_length_m", "step", "norm", size, SHORT_AND_QUICK, words, None, AT_SPEED)
    return [*remaining, sentence]


def _of_flags(flags: Sequence[Flag]) -> list[HeadlineSentence]:
    """Findings based on limits only: raised pelvis in swing."""
    return [
        make_sentence(
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


def _cell(row: ParameterRow, side: Side | None) -> TableCell | None:
    return {"left": row.left, "right": row.right}[side] if side is not None else None


def _number(row: ParameterRow, value: float) -> str:
    return format_amount(row.name, value)
