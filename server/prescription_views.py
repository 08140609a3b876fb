"""What the pages show of feedback prescriptions: the card of a patient, and the form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from core.feedback import PARAMETERS, Prescription
from core.frames import Side
from server.report.feedback_words import prescription_words, title
from server.report.wording import TERMS
from server.services.prescriptions import Written

FIRST: Final = "step_length_m"
"""Trained unless something else is chosen: the length of steps is what most studies train."""

ON_CARD: Final = ("Target", "Shown as", "Schedule", "Level", "Ends")

MODES: Final = (
    ("bar", "Bar", "height by the value, target marked"),
    ("zone", "Zone", "green, yellow, red with its side"),
    ("tone", "Tone", "outside the zone, louder and higher with the error"),
    ("tick", "Tick", "at every contact of the foot"),
)
SOURCES: Final = (
    ("norm", "Norm", "healthy people at this person's speed"),
    ("own_better_side", "Own better side", "the other side in the last walk"),
    ("own_baseline", "Own baseline", "the same side in the last walk"),
    ("manual", "Entered", "mean and SD as typed"),
)


@dataclass(frozen=True)
class Card:
    """The prescription in force, in words, and the ones that ended, newest first."""

    now: Written | None
    title: str
    lines: tuple[tuple[str, str], ...]
    ended: tuple[tuple[str, Written], ...]


def card(written: Sequence[Written]) -> Card:
    """The card of a patient's page."""
    now = next((w for w in written if w.ended_at is None), None)
    lines = () if now is None else tuple(x for x in prescription_words(now.content) if x[0] in ON_CARD)
    return Card(
        now,
        "" if now is None else title(now.content),
        lines,
        tuple((title(w.content), w) for w in written if w.ended_at is not None),
    )


@dataclass(frozen=True)
class Choice:
    """A parameter that can be trained."""

    name: str
    label: str
    unit: str
    digits: int


def choices() -> list[tuple[str, list[Choice]]]:
    """What can be trained under the headings of the parameter table."""
    groups: dict[str, list[Choice]] = {}
    for name, term in TERMS.items():
        if name in PARAMETERS:
            groups.setdefault(term.group, []).append(Choice(name, term.label, term.unit, term.digits))
    return list(groups.items())


def starting_point(now: Written | None, affected: Side | None) -> Prescription:
    """What the form is filled with: the prescription in force, else the defaults for this person."""
    if now is not None:
        return now.content
    return Prescription.from_json({"parameter": FIRST, "side": affected or "left"})
