"""The parameter table: left, right, difference in words, norm where comparable, a reason where no number."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from core.norms import NormValue
from core.parameters.result import Parameter
from server.report.curves import range_svg
from server.report.wording import TERMS, Term, difference_words, number, reason_words

COUNTED: Final[Mapping[str, str]] = {"cadence_spm": "steps", "total_distance_m": "feet"}
"""What a number is the mean of, where not of strides."""


@dataclass(frozen=True)
class Cell:
    """One number with what is behind it; `title` says it in full."""

    value: float
    sd: float | None
    n: int
    text: str
    title: str


@dataclass(frozen=True)
class Row:
    """One parameter.

    Parameters
    ----------
    both : value of the whole take; else `left` and `right`, None where not measured.
    difference : left against right in words. norm : "62.6 ± 2.0". norm_mean, norm_sd, norm_n, norm_source :
        behind it; None where no comparable norm exists, `norm_note` then says why if there is a reason.
    reason : words in place of all numbers, None if there is any.
    low_confidence : of an angle that the estimator's model gives; it has no norm.
    """

    name: str
    title: str
    unit: str
    group: str
    both: Cell | None
    left: Cell | None
    right: Cell | None
    difference: str | None
    reason: str | None
    scale: tuple[float, float]
    norm: str | None = None
    norm_mean: float | None = None
    norm_sd: float | None = None
    norm_n: int | None = None
    norm_source: str | None = None
    norm_note: str = ""
    low_confidence: bool = False

    @property
    def plot(self) -> str:
        """Range bar as SVG."""
        cells = {"left": self.left, "right": self.right, "both": self.both}
        marks = {key: cell.value for key, cell in cells.items() if cell is not None}
        if self.norm_mean is None or self.norm_sd is None:
            return range_svg(marks, None, self.scale)
        return range_svg(marks, (self.norm_mean, self.norm_sd), self.scale)


def parameter_rows(
    parameters: Sequence[Parameter],
    norms: Mapping[str, NormValue],
    estimated: Collection[str] = (),
) -> tuple[Row, ...]:
    """Rows in the order of the table; parameters without wording come last under their own name.

    Parameters
    ----------
    estimated : variables that no two sensors measure; what is derived from them has low confidence.
    """
    found: dict[str, dict[str | None, Parameter]] = {}
    for p in parameters:
        found.setdefault(p.name, {})[p.side] = p
    known = [name for name in TERMS if name in found]
    other = [name for name in found if name not in TERMS]
    rows = (_row(name, found[name], norms.get(name)) for name in (*known, *other))
    return tuple(_unsure(r) if any(r.name.startswith(f"{v}_") for v in estimated) else r for r in rows)


def grouped(rows: Sequence[Row]) -> tuple[tuple[str, tuple[Row, ...]], ...]:
    """Rows under their headings, in order."""
    names = dict.fromkeys(r.group for r in rows)
    return tuple((name, tuple(r for r in rows if r.group == name)) for name in names)


def _row(name: str, sides: Mapping[str | None, Parameter], norm: NormValue | None) -> Row:
    term = TERMS.get(name) or _unknown(name, sides)
    both, left, right = (_cell(sides.get(side), term) for side in (None, "left", "right"))
    missing = both is None and left is None and right is None
    shown = norm if norm is not None and norm.comparable else None
    return Row(
        name=name,
        title=term.label,
        unit=term.unit,
        group=term.group,
        both=both,
        left=left,
        right=right,
        difference=_difference(left, right, sides, term) if both is None and not missing else None,
        reason=reason_words(next(iter(sides.values())).reason) if missing else None,
        scale=term.scale,
        norm=None
        if shown is None
        else f"{number(shown.mean, term.digits)} ± {number(shown.sd, _sd_digits(term))}",
        norm_mean=None if shown is None else shown.mean,
        norm_sd=None if shown is None else shown.sd,
        norm_n=None if shown is None else shown.n,
        norm_source=None if shown is None else shown.source,
        norm_note="" if norm is None else norm.note,
    )


def _unsure(row: Row) -> Row:
    return replace(
        row, norm=None, norm_mean=None, norm_sd=None, norm_n=None, norm_source=None, low_confidence=True
    )


def _difference(
    left: Cell | None, right: Cell | None, sides: Mapping[str | None, Parameter], term: Term
) -> str | None:
    """Words for left against right, or why one side has no number."""
    if left is not None and right is not None:
        return difference_words(left.value, right.value, term)
    side = "left" if left is None else "right"
    absent = sides.get(side)
    return f"{side} {reason_words(None if absent is None else absent.reason)}"


def _cell(p: Parameter | None, term: Term) -> Cell | None:
    if p is None or p.mean is None:
        return None
    spread = "" if p.sd is None else f" ± {number(p.sd, _sd_digits(term))}"
    what = COUNTED.get(p.name, "strides")
    full = f"{number(p.mean, max(term.digits, 1))}{spread}\u202f{term.unit}, mean ± SD of {p.n} {what}"
    return Cell(p.mean, p.sd, p.n, number(p.mean, term.digits), full)


def _sd_digits(term: Term) -> int:
    return max(term.digits, 1)


def _unknown(name: str, sides: Mapping[str | None, Parameter]) -> Term:
    """A parameter that the wording does not know yet shows its own name."""
    values = [p.mean for p in sides.values() if p.mean is not None] or [0.0]
    low, high = min(*values, 0.0), max(*values, 1.0)
    unit = next(iter(sides.values())).unit
    return Term(name, "°" if unit == "deg" else unit, "Other", 2, (low, high), ("larger", "smaller"))
