"""Page for prescribing feedback, and prescription card of a patient."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Final

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from sagittal.core.feedback import Prescription
from sagittal.core.frames import Side
from sagittal.core.parameters.catalogue import CATALOGUE, list_trainable
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients
from sagittal.server.context import Db, Id
from sagittal.server.pages.shell import record_opening, render_page
from sagittal.server.report.words.feedback_words import name_target, prescription_words
from sagittal.server.results import prescriptions
from sagittal.server.results.prescriptions import PatientPrescription

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

FIRST: Final = "step_length_m"
"""Default parameter: step length, trained in most studies."""

ON_CARD: Final = ("Target", "Display name", "Schedule", "Level", "Ends")

MODES: Final = (
    ("bar", "Bar", "bar height shows the value; the target is marked"),
    ("zone", "Zone", "green, yellow or red, with the direction"),
    ("tone", "Tone", "outside the zone, louder and higher with larger error"),
    ("tick", "Tick", "at every contact of the foot"),
)

SOURCES: Final = (
    ("norm", "Norm", "healthy people at this person's speed"),
    ("own_better_side", "Person's better side", "the other side in the last walk, if it is the better one"),
    ("own_baseline", "Person's baseline", "the same side in the last walk"),
    ("manual", "Entered", "mean and SD as entered"),
)


@dataclass(frozen=True)
class PrescriptionPreset:
    """A frequently used prescription.

    Parameters
    ----------
    parameter, modes : of the prescription. sources : of the target; the first available one is used.
    """

    key: str
    title: str
    words: str
    parameter: str
    modes: tuple[str, ...]
    sources: tuple[str, ...]


PRESETS: Final = (
    PrescriptionPreset(
        "longer", "Longer steps", "of the shorter side, shown as stepping stones", "step_length_m", ("zone",),
        ("own_better_side", "norm", "own_baseline"),
    ),
    PrescriptionPreset(
        ""
        "carry", "Longer stance on this leg", "equal stance time on both legs; bar", "single_support_pct",
        ("bar",), ("own_better_side", "norm", "own_baseline"),
    ),
    PrescriptionPreset(
        "heel", "Heel first", "toes higher at initial contact, as a bar and a tone", "foot_pitch_ic_deg",
        ("bar", "tone"), ("own_better_side", "norm", "own_baseline"),
    ),
)  # fmt: skip
"""The choice; everything else has defaults and is found under "More"."""


@dataclass(frozen=True)
class PrescriptionCard:
    """The prescription in force, in words, and earlier ones, newest first."""

    now: PatientPrescription | None
    title: str
    lines: tuple[tuple[str, str], ...]
    ended: tuple[tuple[str, PatientPrescription], ...]


@dataclass(frozen=True)
class TrainableParameter:
    """A parameter available for training."""

    name: str
    label: str
    unit: str
    digits: int
    shared: bool


@router.get("/patients/{pid}/prescription")
def show_prescription(
    request: Request, db: Db, pid: Id, user: Annotated[Identity, require(Action.RUN_LIVE)]
) -> Response:
    """Form for a prescription, filled with the one in force."""
    with db.read() as c:
        patient = patients.get(c, pid)
        now = prescriptions.in_force(c, pid)
    record_opening(request, user, "patient", pid)
    return render_page(
        request, db, user, "prescription.html", "patients",
        patient=patient, now=now, f=fill_form(now, patient.affected_side),
        groups=group_trainable(), modes=MODES, sources=SOURCES, presets=PRESETS,
    )  # fmt: skip


def make_card(written: Sequence[PatientPrescription]) -> PrescriptionCard:
    """Prescription card for a patient's page."""
    now = next((w for w in written if w.ended_at is None), None)
    lines = () if now is None else tuple(x for x in prescription_words(now.content) if x[0] in ON_CARD)
    return PrescriptionCard(
        now,
        "" if now is None else name_target(now.content),
        lines,
        tuple((name_target(w.content), w) for w in written if w.ended_at is not None),
    )


def group_trainable() -> list[tuple[str, list[TrainableParameter]]]:
    """Trainable parameters under the headings of the parameter table."""
    groups: dict[str, list[TrainableParameter]] = {}
    for name in list_trainable():
        e = CATALOGUE[name]
        groups.setdefault(e.group, []).append(
            TrainableParameter(name, e.label, e.printed_unit, e.digits, e.shared)
        )
    return list(groups.items())


def fill_form(now: PatientPrescription | None, affected: Side | None) -> Prescription:
    """Initial values of the form: the prescription in force, otherwise defaults for this patient."""
    if now is not None:
        return now.content
    return Prescription.from_json({"parameter": FIRST, "side": affected or "left"})
