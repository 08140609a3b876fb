"""Wording of a change between two sessions: size, measurement error, clinical relevance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

from sagittal.core.change import NOT_MEASURED_ALIKE, UNLIKE, Change
from sagittal.core.message import Message
from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.core.parameters.variability import TOO_FEW
from sagittal.server.report.words.wording import Term, format_number, parameter_term, title_of

VERDICTS: Final[Mapping[str, str]] = {
    "within_measurement_error": "within measurement error",
    "real_change": "real change",
    "clinically_relevant": "real change, clinically relevant",
}
"""Verdict → words (docs/science/change.md, "Verdict")."""

NO_LIMIT: Final = "measurement error unknown"
SHORT: Final[Mapping[str, str]] = {NO_LIMIT: "no known limit"}
TOO_FEW_WORDS: Final = "too few strides to compare"
NOT_ALIKE_WORDS: Final = "not compared: one is measured, the other estimated"
UNLIKE_WORDS: Final = "not assessed: the conditions differ"

SCORE_TERMS: Final[Mapping[str, Term]] = {
    "gps_sagittal_deg": Term(
        "Sagittal profile score", "°", "Deviation from healthy adults", 1, (0, 20), ("larger", "smaller")
    ),
    "gdi_star_sagittal": Term(
        "GDI*, sagittal", "points", "Deviation from healthy adults", 0, (40, 120), ("larger", "smaller")
    ),
}
"""Scores followed over visits, after the parameters: shape of the curves without offsets."""


@dataclass(frozen=True)
class ChangeWords:
    """A change in words for tables and charts.

    Parameters
    ----------
    size : "+0.22" or "0.00" in the unit of the parameter. mark : "up" or "down" if larger than the
        measurement error, "" if within it, "none" if not assessable.
    verdict : in words. limits : underlying limits with their sources, in sentences.
    about : the changed quantity if it differs from the displayed value, otherwise "".
    """

    side: str | None
    size: str
    mark: str
    verdict: str
    limits: tuple[str, ...]
    about: str = ""

    @property
    def short(self) -> str:
        """The assessment in two words, if possible."""
        if self.mark in {"up", "down"}:
            return "changed"
        return "within measurement error" if not self.mark else SHORT.get(self.verdict, self.verdict)


def find_term(name: str, unit: str = "") -> Term:
    """Term of a parameter; its own name if it has no label."""
    if name in CATALOGUE:
        term = parameter_term(name)
        return replace(term, label=title_of(name, term.label))
    score_term = SCORE_TERMS.get(name)
    printed_unit = "°" if unit == "deg" else unit
    return score_term or Term(name, printed_unit, "Other", 2, (0.0, 1.0), ("larger", "smaller"))


def change_words(change: Change) -> ChangeWords:
    """Describe a change in words."""
    term = find_term(change.name, change.unit)
    if change.difference is None:
        text = NOT_ALIKE_WORDS if change.reason == NOT_MEASURED_ALIKE else "not measured in both"
        return ChangeWords(change.side, "–", "none", text, limit_words(change))
    mark = "none" if change.verdict is None else ""
    if change.verdict in {"real_change", "clinically_relevant"}:
        mark = "up" if change.difference > 0 else "down"
    return ChangeWords(
        change.side, format_difference(change.difference, term), mark, _verdict(change), limit_words(change)
    )


def format_difference(difference: float, term: Term) -> str:
    """A difference with its sign, "+0.22"; without sign if it rounds to zero."""
    text = format_number(difference, term.digits)
    return f"+{text}" if difference > 0 and float(f"{difference:.{term.digits}f}") else text


def limit_words(change: Change) -> tuple[str, ...]:
    """Limits of a parameter with their sources, for any population."""
    term = find_term(change.name, change.unit)
    unit = "" if not term.unit else term.unit if term.unit in "°%" else f"\u202f{term.unit}"
    sentences = []
    if change.limit is not None:
        people = f" ({change.people})" if change.people else ""
        sentences.append(
            Message(
                "MDC {limit}{unit}: {limit_source}{people}.",
                limit=format_limit(change.limit, term),
                unit=unit,
                limit_source=change.limit_source,
                people=people,
            )
        )
    if change.mcid is not None:
        sentences.append(
            Message(
                "MCID {mcid}{unit}: {mcid_source}.",
                mcid=format_limit(change.mcid, term),
                unit=unit,
                mcid_source=change.mcid_source,
            )
        )
    return tuple(sentences)


def format_limit(limit: float, term: Term) -> str:
    """A limit of change without its unit: one decimal more than for tenths, metres in millimetres."""
    return format_number(limit, max(term.digits, 3 if term.unit == "m" else 1))


def _verdict(change: Change) -> str:
    if change.verdict is None:
        return {TOO_FEW: TOO_FEW_WORDS, UNLIKE: UNLIKE_WORDS}.get(change.reason or "", NO_LIMIT)
    text = VERDICTS[change.verdict]
    if change.verdict == "real_change" and change.mcid is not None:
        text += ", smaller than clinically relevant"
    if change.verdict != "within_measurement_error" and change.towards_norm is not None:
        text += ", towards the norm" if change.towards_norm else ", away from the norm"
    if change.note == "from_standing":
        text += "; includes the standing posture"
    return text
