"""Care teams and emergency access to patients."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Request

from sagittal.server.api import schemas
from sagittal.server.api.documents import refusals
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients
from sagittal.server.context import Db, Failures, Id, OpenTrail, address_of
from sagittal.server.errors import NotFound
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.sharing import care_teams

router = APIRouter(route_class=StrictJsonRoute, tags=["care teams"])
Admin = Annotated[Identity, require(Action.MANAGE_USERS)]


@router.get("/care-teams", response_model=schemas.CareTeams)
def read_option(db: Db, user: Admin) -> schemas.CareTeams:
    """Whether the clinic has care teams."""
    with db.read() as c:
        return schemas.CareTeams(on=care_teams.are_on(c))


@router.put("/care-teams", response_model=schemas.CareTeams)
def switch(body: schemas.CareTeamsSwitch, db: Db, user: Admin) -> schemas.CareTeams:
    """Restrict patients to their care team, or lift the restriction; teams are retained."""
    with db.write() as c:
        if body.on:
            care_teams.switch_on(c, user, begin_with_past=body.begin_with_past)
        else:
            care_teams.switch_off(c, user)
        return schemas.CareTeams(on=care_teams.are_on(c))


@router.get("/patients/{patient_id}/care-team", response_model=schemas.CareTeam)
def read_team(
    patient_id: Id, db: Db, trail: OpenTrail, user: Annotated[Identity, require(Action.READ_PATIENT)]
) -> schemas.CareTeam:
    """Care team of a patient, and recent emergency access to the patient."""
    with db.read() as c:
        patients.get(c, patient_id)
        team = schemas.CareTeam(care_teams.list_team(c, patient_id), care_teams.list_accesses(c, patient_id))
    trail.record_opened(user, "care_team.opened", "patient", patient_id)
    return team


@router.put("/patients/{patient_id}/care-team", response_model=schemas.CareTeam)
def set_team(patient_id: Id, body: schemas.CareTeamChange, db: Db, user: Admin) -> schemas.CareTeam:
    """Set the care team of a patient by account ids; all others leave it."""
    with db.write() as c:
        team = care_teams.set_team(c, user, patient_id, body.users)
        return schemas.CareTeam(team, care_teams.list_accesses(c, patient_id))


@router.post(
    "/emergency-accesses",
    status_code=201,
    response_model=care_teams.EmergencyAccess,
    responses=refusals(404, 409, 429),
)
def open_in_emergency(
    request: Request,
    body: schemas.EmergencyOpening,
    db: Db,
    trail: OpenTrail,
    failures: Failures,
    user: Annotated[Identity, require(Action.OPEN_IN_EMERGENCY)],
) -> care_teams.EmergencyAccess:
    """Open a patient with a known exact code for four hours; team and administrators can see the access."""
    # counted, so that codes cannot be guessed; with a separate key, so that failed sign-ins from the clinic's
    # shared address do not block emergency access, nor wrong codes the sign-in
    account, address = f"emergency of {user.user_id}", f"emergency {address_of(request)}"
    attempt = failures.begin(account, address)
    try:
        with db.write() as c:
            opened = care_teams.open_in_emergency(c, user, body.code, body.reason)
    except NotFound:
        trail.record_opened(user, "emergency.refused", "patient", None)
        raise
    except BaseException:
        failures.withdraw(account, address, attempt)
        raise
    failures.withdraw(account, address, attempt)
    return opened


@router.post("/emergency-accesses/{access_id}/end", response_model=care_teams.EmergencyAccess)
def end_emergency(
    access_id: Id, db: Db, user: Annotated[Identity, require(Action.OPEN_IN_EMERGENCY)]
) -> care_teams.EmergencyAccess:
    """End one's own emergency access, or any as administrator; links created during it end too."""
    with db.write() as c:
        return care_teams.end_emergency(c, user, access_id)
