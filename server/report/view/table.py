"""Parameter table: left, right, difference in words, comparable norms, reasons for missing values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, sqrt
from typing import Final

from sagittal.core.events.result import COMPARED
from sagittal.core.frames import Side
from sagittal.core.message import Message
from sagittal.core.norms.kinematics import Zero
from sagittal.core.norms.lookup import Norms
from sagittal.core.norms.values import NormValue
from sagittal.core.parameters.catalogue import CATALOGUE, name_counted
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.symmetry import Symmetry, compare_sides
from sagittal.core.parameters.variability import NORMAL_95, has_enough_values
from sagittal.core.plurals import plural
from sagittal.server.report.charts.curves import range_svg
from sagittal.server.report.words.change_words import ChangeWords
from sagittal.server.report.words.wording import (
    GROUPS,
    NO_DIFFERENCE,
    Term,
    difference_words,
    format_number,
    format_uncertainty,
    parameter_term,
    reason_words,
    symmetry_words,
    title_of,
)

NOBODY: Final = Norms(None, None)
"""No reference group."""


FEW_NOTE: Final = Message(
    "No norm: at least {COMPARED} strides per side are needed for a comparison.", COMPARED=COMPARED
)
"""What stands in place of a norm where no side has enough strides."""


BEYOND_SD: Final = 2.0
"""z-score outside the normal range."""


@dataclass(frozen=True)
class TableCell:
    """One number with its statistics; `title` is the full text.

    Parameters
    ----------
    ci : 95 % confidence interval of the mean over the strides. cv_pct : None below 10 strides.
    z, percentile : relative to the norm, None without a comparable norm or with too few strides.
    few : "3 strides" if too few for a comparison, otherwise "".
    uncertainty : 95 % uncertainty from strides and measurement; None if unknown.
    plus_minus : "± 0.03", "" without. known_by : both components in words, for the parameter page.
    """

    value: float
    sd: float | None
    n: int
    text: str
    title: str
    ci: tuple[float, float] | None = None
    cv_pct: float | None = None
    z: float | None = None
    percentile: float | None = None
    few: str = ""
    uncertainty: float | None = None
    plus_minus: str = ""
    known_by: str = ""


@dataclass(frozen=True)
class ParameterRow:
    """One parameter.

    Parameters
    ----------
    both : value of the whole trial; otherwise `left` and `right`, None if not measured.
    difference : left against right in words. norm : "62.6 ± 2.0". norm_mean, norm_sd, norm_n, norm_source :
        its statistics; None without a comparable norm or with too few included strides on every side;
        `norm_note` then gives the reason, if any. norm_group : reference group in words.
    comfortable : norm at comfortable speed with its statistics, if `norm` is at the patient's speed;
        otherwise None.
    reason : replaces all numbers, None if there are any. side_reason : for the only side without one.
    whole : applies to the trial, not to its sides.
    low_confidence : angle estimated by a model, without a norm. low_side : the only side concerned, empty if
        all sides with a value are.
    symmetry : left against right in numbers, None unless both sides have enough strides.
    change : since the previous visit, for every side with one; empty without such a visit.
    """

    name: str
    title: str
    unit: str
    group: str
    both: TableCell | None
    left: TableCell | None
    right: TableCell | None
    difference: str | None
    reason: str | None
    scale: tuple[float, float]
    side_reason: str | None = None
    whole: bool = False
    norm: str | None = None
    norm_mean: float | None = None
    norm_sd: float | None = None
    norm_n: int | None = None
    norm_source: str | None = None
    norm_group: str | None = None
    norm_note: str = ""
    comfortable: str | None = None
    comfortable_mean: float | None = None
    comfortable_sd: float | None = None
    comfortable_source: str | None = None
    comfortable_group: str | None = None
    low_confidence: bool = False
    low_side: str = ""
    symmetry: Symmetry | None = None

    @property
    def symmetry_words(self) -> str:
        """Ratio, index and angle of the two sides in words; empty unless they clearly differ."""
        return "" if self.symmetry is None or not self.symmetry.clear else symmetry_words(self.symmetry)

    change: tuple[ChangeWords, ...] = ()

    @property
    def z_words(self) -> str:
        """z-scores left and right, in words; empty without a norm."""
        cells = (self.both,) if self.both is not None else (self.left, self.right)
        if all(c is None or c.z is None for c in cells):
            return ""
        return "z " + " | ".join("–" if c is None or c.z is None else format_number(c.z, 1) for c in cells)

    @property
    def z_marks(self) -> tuple[tuple[str, bool], ...]:
        """z-scores as text and whether they exceed the normal range."""
        cells = (self.both,) if self.both is not None else (self.left, self.right)
        if all(c is None or c.z is None for c in cells):
            return ()
        return tuple(
            ("–", False) if c is None or c.z is None else (format_number(c.z, 1), abs(c.z) > BEYOND_SD)
            for c in cells
        )

    @property
    def plot(self) -> str:
        """Range bar as SVG."""
        cells = {"left": self.left, "right": self.right, "both": self.both}
        if self.norm_mean is None or self.norm_sd is None:
            marks = {key: cell.value for key, cell in cells.items() if cell is not None}
            return range_svg(marks, None, self.scale)
        # a side with too few strides is not shown with the norm of the other
        marks = {key: cell.value for key, cell in cells.items() if cell is not None and not cell.few}
        return range_svg(marks, (self.norm_mean, self.norm_sd), self.scale)


def parameter_rows(
    parameters: Sequence[Parameter],
    norms: Norms = NOBODY,
    affected: Side | None = None,
    zero: Zero = "standing",
) -> tuple[ParameterRow, ...]:
    """Rows in table order; parameters without a label come last under their own name.

    Parameters
    ----------
    affected : numerator of ratios, None = left over right.
    zero : zero of joint angles.
    """
    by_name: dict[str, dict[str | None, Parameter]] = {}
    for p in parameters:
        by_name.setdefault(p.name, {})[p.side] = p
    ordered = [name for name in CATALOGUE if name in by_name]
    unknown = [name for name in by_name if name not in CATALOGUE]
    rows = (_row(name, by_name[name], norms, affected, zero) for name in (*ordered, *unknown))
    return tuple(_unsure(row, by_name[row.name]) for row in rows)


def group_rows(rows: Sequence[ParameterRow]) -> tuple[tuple[str, tuple[ParameterRow, ...]], ...]:
    """Rows under their headings, in order."""
    names = dict.fromkeys(r.group for r in rows)
    return tuple((name, tuple(r for r in rows if r.group == name)) for name in names)


def _row(
    name: str, sides: Mapping[str | None, Parameter], norms: Norms, affected: Side | None, zero: Zero
) -> ParameterRow:
    term = parameter_term(name) if name in CATALOGUE else _unknown(name, sides)
    norm = norms.values.get(name)
    whole_trial, left, right = (_cell(sides.get(side), term, norms) for side in (None, "left", "right"))
    missing = whole_trial is None and left is None and right is None
    symmetry = next(iter(compare_sides(tuple(sides.values()), affected)), None)
    displayed_norm = norm if norm is not None and norm.comparable else None
    few = (
        displayed_norm is not None
        and not missing
        and all(c is None or c.few for c in (whole_trial, left, right))
    )
    displayed_norm = None if few else displayed_norm
    usual = None if displayed_norm is None else norms.comfortable.get(name)
    usual = usual if usual is not None and usual.comparable else None
    absent = [side for side, cell in (("left", left), ("right", right)) if cell is None]
    side_reason = _reason_of(sides.get(absent[0])) if len(absent) == 1 and whole_trial is None else None
    side_text = None if side_reason is None else f"{absent[0]} {side_reason}"
    return ParameterRow(
        name=name,
        title=title_of(name, term.label, zero),
        unit=term.unit,
        group=term.group,
        both=whole_trial,
        left=left,
        right=right,
        difference=side_text or _difference(left, right, term, symmetry),
        reason=_reason_of(next(iter(sides.values()))) if missing else None,
        scale=term.scale,
        side_reason=side_reason,
        whole=None in sides,
        norm=_norm_text(displayed_norm, term),
        norm_mean=None if displayed_norm is None else displayed_norm.mean,
        norm_sd=None if displayed_norm is None else displayed_norm.sd,
        norm_n=None if displayed_norm is None else displayed_norm.n,
        norm_source=None if displayed_norm is None else displayed_norm.source,
        norm_group=None if displayed_norm is None else GROUPS.get(displayed_norm.group, displayed_norm.group),
        norm_note=FEW_NOTE if few else "" if norm is None else norm.note,
        comfortable=_norm_text(usual, term),
        comfortable_mean=None if usual is None else usual.mean,
        comfortable_sd=None if usual is None else usual.sd,
        comfortable_source=None if usual is None else usual.source,
        comfortable_group=None if usual is None else GROUPS.get(usual.group, usual.group),
        symmetry=symmetry,
    )


def _norm_text(norm: NormValue | None, term: Term) -> str | None:
    if norm is None:
        return None
    return f"{format_number(norm.mean, term.digits)} ± {format_number(norm.sd, _sd_digits(term))}"


def _unsure(row: ParameterRow, sides: Mapping[str | None, Parameter]) -> ParameterRow:
    """Remove comparisons of low-confidence angles with norm and other side; measured sides keep theirs."""
    unsure = tuple(side for side, p in sides.items() if p.estimated and p.mean is not None)
    if not unsure:
        return row

    def bare(side: Side | None, cell: TableCell | None) -> TableCell | None:
        return cell if cell is None or side not in unsure else replace(cell, z=None, percentile=None)

    marked = replace(
        row,
        both=bare(None, row.both),
        left=bare("left", row.left),
        right=bare("right", row.right),
        low_confidence=True,
        low_side="" if len(unsure) > 1 else unsure[0] or "",
        difference=None if row.side_reason is None else row.difference,
        symmetry=None,
    )
    if any(p.mean is not None for side, p in sides.items() if side not in unsure):
        return marked
    return replace(
        marked,
        norm=None,
        norm_mean=None,
        norm_sd=None,
        norm_n=None,
        norm_source=None,
        norm_group=None,
        comfortable=None,
        comfortable_mean=None,
        comfortable_sd=None,
        comfortable_source=None,
        comfortable_group=None,
        low_side="",
    )


def _difference(
    left: TableCell | None, right: TableCell | None, term: Term, symmetry: Symmetry | None
) -> str | None:
    """Words for left against right; None if too few strides are compared."""
    if left is None or right is None or symmetry is None:
        return None
    same = difference_words(left.value, right.value, term)
    return same if symmetry.clear or same == NO_DIFFERENCE else "no clear difference"


def _reason_of(p: Parameter | None) -> str:
    return reason_words(None if p is None else p.reason)


def _cell(p: Parameter | None, term: Term, norms: Norms) -> TableCell | None:
    if p is None or p.mean is None:
        return None
    digits = max(term.digits, 1)
    spread = "" if p.sd is None else f" ± {format_number(p.sd, _sd_digits(term))}"
    cycle_name = name_counted(p.name)
    cycles = plural(p.n, cycle_name.removesuffix("s"), cycle_name)
    title_parts: list[str] = [
        Message(
            "{mean}{spread}\u202f{unit}, mean ± SD of {value} {cycles}",
            mean=format_number(p.mean, digits),
            spread=spread,
            unit=term.unit,
            value=p.n,
            cycles=cycles,
        )
    ]
    ci = None if p.ci_low is None or p.ci_high is None else (p.ci_low, p.ci_high)
    if ci is not None:
        title_parts.append(
            Message(
                "95 % CI {format_number} to {format_number2}",
                format_number=format_number(ci[0], digits),
                format_number2=format_number(ci[1], digits),
            )
        )
    if p.cv_pct is not None:
        title_parts.append(
            f"CV {format_number(p.cv_pct, 1)} %{f' of few {cycle_name}' if p.note == 'few_strides' else ''}"
        )
    enough = has_enough_values(p)
    place = norms.place(p.name, p.mean if enough else None, p.uncertainty)
    if place.z is not None and place.percentile is not None:
        title_parts.append(
            Message(
                "z {place}, percentile {percentile} of the norm",
                place=format_number(place.z, 1),
                percentile=format_number(place.percentile),
            )
        )
    return TableCell(
        p.mean,
        p.sd,
        p.n,
        format_number(p.mean, term.digits),
        "; ".join(title_parts),
        ci,
        p.cv_pct,
        place.z,
        place.percentile,
        "" if enough else f"{p.n} {cycles}",
        p.uncertainty,
        "" if p.uncertainty is None else format_uncertainty(p.uncertainty, term.digits),
        _known_by(p, term),
    )


def _known_by(p: Parameter, term: Term) -> str:
    """Components of the uncertainty, in words; empty if unknown."""
    entry = CATALOGUE.get(p.name)
    if p.u_own is None or p.u_common is None or entry is None or entry.errors is None:
        return ""
    measured = NORMAL_95 * hypot(p.u_own, p.u_common)
    digits = max(term.digits, 1)
    if p.uncertainty is None:
        return Message(
            "± not known: {value} of {name} does not say how they differ; {source} ± {measured}\u202f"
            "{unit} (95 %)",
            value=p.n,
            name=name_counted(p.name),
            source=entry.errors.source,
            measured=format_number(measured, digits),
            unit=term.unit,
        )
    strides = sqrt(max(p.uncertainty**2 - measured**2, 0.0))
    return (
        f"± {format_number(p.uncertainty, digits)}\u202f{term.unit} (95 %): strides "
        f"± {format_number(strides, digits)}, {entry.errors.source} ± {format_number(measured, digits)}"
    )


def _sd_digits(term: Term) -> int:
    return max(term.digits, 1)


def _unknown(name: str, sides: Mapping[str | None, Parameter]) -> Term:
    """Term for a parameter without a label: its own name."""
    values = [p.mean for p in sides.values() if p.mean is not None] or [0.0]
    low, high = min(*values, 0.0), max(*values, 1.0)
    unit = next(iter(sides.values())).unit
    return Term(name, "°" if unit == "deg" else unit, "Other", 2, (low, high), ("larger", "smaller"))
