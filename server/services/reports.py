"""The report of an analysis: its stored files read back and put into words, for pages, API and tables."""

from __future__ import annotations

from server.report.bundle import Bundle, load_bundle
from server.report.model import ReportModel, report_model
from server.services import analyses
from server.services.patients import Patient
from server.services.sessions import Session
from server.storage.blobs import BlobStore

NOT_READ = "poses.parquet"
"""Only the replay needs it."""


def read(
    blobs: BlobStore, found: analyses.Analysis, patient: Patient, session: Session
) -> tuple[Bundle, ReportModel]:
    """Read an analysis and describe it for this person on that day; raises IntegrityError."""
    files = {name: analyses.file_bytes(blobs, found, name) for name in found.files if name != NOT_READ}
    bundle = load_bundle(files)
    age = session.performed_on.year - patient.birth_year if patient.birth_year else None
    return bundle, report_model(bundle, age=age, sex=patient.sex)  # type: ignore[arg-type]
