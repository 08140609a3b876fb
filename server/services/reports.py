"""The report of an analysis: its stored files and edits put into words, for pages, API and tables."""

from __future__ import annotations

from server.report.behind import Behind, behind
from server.report.bundle import Bundle
from server.report.model import ReportModel, report_model
from server.services import analyses, reviews
from server.services.errors import NotFound
from server.services.patients import Patient
from server.services.sessions import Session
from server.storage.blobs import BlobStore


def read(
    blobs: BlobStore, found: analyses.Analysis, edits: reviews.Edits, patient: Patient, session: Session
) -> tuple[Bundle, ReportModel]:
    """Describe an analysis with its edits for this person on that day; raises IntegrityError."""
    bundle = reviews.bundle(blobs, found, edits)
    age = session.performed_on.year - patient.birth_year if patient.birth_year else None
    height = session.height_m if session.height_m is not None else patient.height_m
    return bundle, report_model(bundle, age=age, sex=patient.sex, height_m=height)  # type: ignore[arg-type]


def behind_number(
    blobs: BlobStore,
    found: analyses.Analysis,
    edits: reviews.Edits,
    patient: Patient,
    session: Session,
    name: str,
) -> Behind:
    """One parameter with the strides behind it; raises NotFound, IntegrityError."""
    bundle, model = read(blobs, found, edits, patient, session)
    row = next((r for _, rows in model.groups for r in rows if r.name == name), None)
    if row is None:
        raise NotFound("parameter", name)
    columns = reviews.columns(blobs, found, edits)
    return behind(row, bundle.strides, columns.get(name), model.duration_s)
