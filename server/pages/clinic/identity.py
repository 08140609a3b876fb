"""Who a patient is, beside the pseudonym: a page of its own, so that each look at it is written down."""

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
    who: Annotated[Identity, require(Action.READ_IDENTITY)],
) -> Response:
    """Name, date of birth, numbers and contact, to read and to change."""
    with db.read() as c:
        patient = patients.get(c, pid)
        known = identities.get(c, settings.identity_key_file, pid)
    state_of(request).trail.record_opened(who, "identity.opened", "patient", pid)
    return render_page(
        request, db, who, "identity.html", "patients",
        patient=patient, known=known, most=identities.MOST, oldest=identities.OLDEST,
    )  # fmt: skip


def offers_identity(settings: Settings) -> bool:
    """Whether pages lead to names: there is a key, or a setting says where it ought to be; asks no table.

    A missing key is said by the page that they lead to.
    """
    return bool(settings.identity_key) or settings.identity_key_file.is_file()


def name_on_paper(
    request: Request, db: Database, settings: Settings, who: Identity, patient_id: str, *, named: bool
) -> dict[str, Any]:
    """What a report needs to bear the name, where that is asked for and allowed; the look is written down.

    What is signed, and so what a link leads to, never passes here.
    """
    may, known = who.may(Action.READ_IDENTITY) and offers_identity(settings), None
    if may and named:
        with db.read() as c:
            known = identities.get(c, settings.identity_key_file, patient_id)
        state_of(request).trail.record_opened(who, "identity.printed", "patient", patient_id)
    return {"may_name": may, "person": known}
