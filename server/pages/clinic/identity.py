"""Identity of a patient, on a separate page so that each access is audited."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import identities, patients
from sagittal.server.context import Config, Db, Id, state_of
from sagittal.server.pages.shell import render_page
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


@router.get("/patients/{pid}/identity")
def show_identity(
    request: Request,
    db: Db,
    settings: Config,
    pid: Id,
    user: Annotated[Identity, require(Action.READ_IDENTITY)],
) -> Response:
    """View and edit name, date of birth, numbers and contact."""
    with db.read() as c:
        patient = patients.get(c, pid)
        identity = identities.get(c, settings.identity_key_file, pid)
    state_of(request).trail.record_opened(user, "identity.opened", "patient", pid)
    return render_page(
        request, db, user, "identity.html", "patients",
        patient=patient, known=identity, most=identities.MOST, oldest=identities.OLDEST,
    )  # fmt: skip


def offers_identity(settings: Settings) -> bool:
    """Whether to link to identities: a key exists or is configured; reads no table.

    A missing key is reported on the linked page.
    """
    return bool(settings.identity_key) or settings.identity_key_file.is_file()


def name_on_paper(
    request: Request, db: Database, settings: Settings, user: Identity, patient_id: str, *, named: bool
) -> dict[str, Any]:
    """Template context for printing the patient's name on a report, if requested and permitted; audited.

    Not used for signed reports, which may be shared by links.
    """
    may, identity = user.may(Action.READ_IDENTITY) and offers_identity(settings), None
    if may and named:
        with db.read() as c:
            identity = identities.get(c, settings.identity_key_file, patient_id)
        state_of(request).trail.record_opened(user, "identity.printed", "patient", patient_id)
    return {"may_name": may, "person": identity}
