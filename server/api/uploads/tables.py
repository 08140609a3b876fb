"""Uploaded tables: likely content, check of a mapping, and mapping."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter
from pydantic import Field

from sagittal.server.api import schemas
from sagittal.server.api.documents import refusals
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Blobs, Db, Id, OpenTrail
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.uploads import tables
from sagittal.server.uploads.tables import TableReading, TableShape

router = APIRouter(
    prefix="/sessions/{session_id}/tables",
    route_class=StrictJsonRoute,
    tags=["files"],
    responses=refusals(409),
)
Uploader = Annotated[Identity, require(Action.UPLOAD)]
Name = Annotated[str, Field(min_length=1, max_length=500)]


class TableCheckNew(schemas.Request):
    """A file and an entry of the manifest's `sources` without `file`; a sensor `*` is named after the
    file.
    """

    file: Name
    source: schemas.Json


class TableMapping(schemas.Request):
    """Files of one shape and their common mapping."""

    files: Annotated[tuple[Name, ...], Field(min_length=1, max_length=1000)]
    source: schemas.Json


@router.get("", response_model=list[TableShape])
def list_tables(session_id: Id, db: Db, blobs: Blobs, trail: OpenTrail, user: Uploader) -> list[TableShape]:
    """List the tables of the current recording by columns, with their likely content."""
    with db.read() as c:
        shapes = tables.list_tables(c, blobs, session_id)
    trail.record_watched(user, "recording.opened", "session", session_id)
    return list(shapes)


@router.post("/checks", response_model=list[TableReading])
def check_table(
    session_id: Id, body: TableCheckNew, db: Db, blobs: Blobs, user: Uploader
) -> list[TableReading]:
    """Apply a mapping to the beginning of a table and return the sensor values; changes nothing."""
    with db.read() as c:
        return list(tables.check_table(c, blobs, session_id, body.file, body.source))


@router.put("", response_model=schemas.RecordingAnswer)
def map_tables(session_id: Id, body: TableMapping, db: Db, user: Uploader) -> schemas.RecordingAnswer:
    """Set the mapping of tables: one manifest entry per file."""
    with db.write() as c:
        shapes = tables.map_tables(c, user, session_id, body.files, body.source)
        return schemas.make_answer(schemas.RecordingAnswer, shapes)
