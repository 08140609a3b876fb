"""Archive of a visit, for storage or import into another installation."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from typing import IO, Annotated

from fastapi import APIRouter
from starlette.responses import StreamingResponse

from sagittal.server.api.downloads.downloads import BINARY
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients, sessions
from sagittal.server.context import Blobs, Db, Id, OpenTrail, Reviewed
from sagittal.server.downloads import archives
from sagittal.server.report.tables import curves_csv, parameters_csv
from sagittal.server.results import analyses, controls, edit_log, reports
from sagittal.server.sharing import signed_reports
from sagittal.server.uploads import recordings

router = APIRouter(prefix="/sessions/{session_id}", tags=["report"])
_PIECE = 1 << 20
_ZIP = "application/zip"


@router.get(
    "/archive.zip",
    response_class=StreamingResponse,
    responses={200: {"description": "The archive", "content": {_ZIP: {"schema": BINARY}}}},
)
def read_archive(
    session_id: Id,
    db: Db,
    blobs: Blobs,
    reviewed: Reviewed,
    trail: OpenTrail,
    user: Annotated[Identity, require(Action.READ_RESULT)],
) -> StreamingResponse:
    """Recording, manifest, settings, results, tables and signed report of the displayed analysis."""
    with db.read() as c:
        session = sessions.get(c, session_id)
        patient = patients.get(c, session.patient_id)
        record = analyses.get_shown(c, session_id)
        recording = recordings.get(c, record.recording_id)
        edits = edit_log.edits_of(c, record.id)
        control_group = controls.list_visits(c, patient, session)
        signed = signed_reports.find_documents(c, session_id)
    model = reports.read(reviewed, record, edits, patient, session, control_visits=control_group)[1]
    tables = {"parameters.csv": parameters_csv(model), "curves.csv": curves_csv(model)}
    out = tempfile.TemporaryFile()  # noqa: SIM115 - the answer closes it
    try:
        archives.write_archive(out, blobs, recording, record, edits, tables, signed)
    except BaseException:
        out.close()
        raise
    trail.record_opened(user, "archive.opened", "session", session_id, {"analysis_id": record.id})
    size = out.tell()
    out.seek(0)
    headers = {
        "Content-Disposition": f'attachment; filename="visit-{session_id[:8]}.zip"',
        "Content-Length": str(size),
    }
    return StreamingResponse(_pieces(out), media_type=_ZIP, headers=headers)


def _pieces(out: IO[bytes]) -> Iterator[bytes]:
    with out:
        while piece := out.read(_PIECE):
            yield piece
