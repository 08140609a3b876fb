"""Sensitivity analyses of squats: request, list, read."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import APIRouter
from pydantic import Field

from sagittal.server.api import schemas
from sagittal.server.api.documents import refusals
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Blobs, Db, Id, OpenTrail, Queue
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.jobs.queue import JobView
from sagittal.server.results import analyses, sensitivities

router = APIRouter(route_class=StrictJsonRoute, tags=["sensitivities"])
Reader = Annotated[Identity, require(Action.READ_RESULT)]


class SensitivityNew(schemas.Request):
    """Reference and zero of the angles."""

    reference: Annotated[
        str | None,
        Field(max_length=500, description="name of an uploaded angles.parquet; null: the take's own angles"),
    ] = None
    from_standing: Annotated[
        bool, Field(description="angles from standing, as the session shows them; false: anatomical")
    ] = True


@dataclass(frozen=True)
class SensitivityResult:
    """A finished sensitivity analysis with its tables (schema 1, angles in degrees)."""

    about: sensitivities.StoredSensitivity
    result: dict[str, Any]


@router.post(
    "/sessions/{session_id}/sensitivities",
    status_code=202,
    response_model=JobView,
    responses=refusals(404, 409),
)
def start(
    session_id: Id,
    body: SensitivityNew,
    db: Db,
    queue: Queue,
    user: Annotated[Identity, require(Action.ANALYSE)],
) -> JobView:
    """Perturb each of 24 body and sensor parameters in turn, and compute the change of the angles."""
    with db.write() as c:
        return sensitivities.submit(
            c, queue, user, session_id, reference=body.reference, from_standing=body.from_standing
        )


@router.get("/sessions/{session_id}/sensitivities", response_model=list[sensitivities.StoredSensitivity])
def list_sensitivities(
    session_id: Id, db: Db, trail: OpenTrail, user: Reader
) -> list[sensitivities.StoredSensitivity]:
    """List finished sensitivity analyses of a session, newest first."""
    with db.read() as c:
        rows = sensitivities.of_session(c, session_id)
    trail.record_watched(user, "sensitivities.opened", "session", session_id)
    return rows


@router.get("/sensitivities/{sensitivity_id}", response_model=SensitivityResult)
def read_sensitivity(
    sensitivity_id: Id, db: Db, blobs: Blobs, trail: OpenTrail, user: Reader
) -> SensitivityResult:
    """One analysis with its tables; `id` is that of the job. The CSV is among the files of the analysis."""
    with db.read() as c:
        row = sensitivities.get(c, sensitivity_id)
        analysis, name = sensitivities.find_file(c, row)
    content = analyses.file_bytes(blobs, analysis, name)
    trail.record_opened(user, "sensitivity.opened", "sensitivity", sensitivity_id)
    return SensitivityResult(row, json.loads(content))
