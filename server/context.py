"""What endpoints take from the running application, as typed dependencies.

Asynchronous: for each that is not, FastAPI takes a thread; on a busy machine a page waits for all in turn.
"""

from __future__ import annotations

import datetime as dt
from typing import Annotated, Literal, cast

from fastapi import Depends, Path, Query
from starlette.requests import HTTPConnection

from sagittal.core.frames import Protocol
from sagittal.server.auth.sessions import Logins
from sagittal.server.auth.throttle import Throttle
from sagittal.server.downloads.studies import StudyChoice
from sagittal.server.jobs.feed import JobFeed
from sagittal.server.jobs.queue import JobQueue
from sagittal.server.live.hub import Hub
from sagittal.server.live_takes.films import FilmIntake
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.settings import Settings
from sagittal.server.storage.blobs import BlobStore
from sagittal.server.storage.db import Database
from sagittal.server.trail import AuditTrail


async def _settings(connection: HTTPConnection) -> Settings:
    return cast("Settings", connection.app.state.settings)


async def _db(connection: HTTPConnection) -> Database:
    return cast("Database", connection.app.state.db)


async def _blobs(connection: HTTPConnection) -> BlobStore:
    return cast("BlobStore", connection.app.state.blobs)


async def _reviewed(connection: HTTPConnection) -> ReviewedAnalyses:
    return cast("ReviewedAnalyses", connection.app.state.reviewed)


async def _logins(connection: HTTPConnection) -> Logins:
    return cast("Logins", connection.app.state.logins)


async def _trail(connection: HTTPConnection) -> AuditTrail:
    return cast("AuditTrail", connection.app.state.trail)


async def _throttle(connection: HTTPConnection) -> Throttle:
    return cast("Throttle", connection.app.state.throttle)


async def _queue(connection: HTTPConnection) -> JobQueue:
    return cast("JobQueue", connection.app.state.queue)


async def _feed(connection: HTTPConnection) -> JobFeed:
    return cast("JobFeed", connection.app.state.feed)


async def _hub(connection: HTTPConnection) -> Hub:
    return cast("Hub", connection.app.state.hub)


async def _films(connection: HTTPConnection) -> FilmIntake:
    return cast("FilmIntake", connection.app.state.films)


Config = Annotated[Settings, Depends(_settings)]
Db = Annotated[Database, Depends(_db)]
Blobs = Annotated[BlobStore, Depends(_blobs)]
Reviewed = Annotated[ReviewedAnalyses, Depends(_reviewed)]
Queue = Annotated[JobQueue, Depends(_queue)]
Feed = Annotated[JobFeed, Depends(_feed)]
LiveHub = Annotated[Hub, Depends(_hub)]
Films = Annotated[FilmIntake, Depends(_films)]
OpenTrail = Annotated[AuditTrail, Depends(_trail)]
OpenLogins = Annotated[Logins, Depends(_logins)]
Failures = Annotated[Throttle, Depends(_throttle)]

HEX_ID = r"^[0-9a-f]{32}$"
"""How an identifier looks."""
Id = Annotated[str, Path(pattern=HEX_ID, description="32 hex digits")]
DeviceId = Annotated[str, Path(pattern=r"^[0-9A-Za-z:-]{2,32}$", description="serial number of a sensor")]


async def _study_choice(
    q: Annotated[str, Query(max_length=200, description="part of a patient's code or note")] = "",
    protocol: Annotated[Protocol | Literal[""], Query(description="of the visits; empty = any")] = "",
    since: Annotated[dt.date | Literal[""], Query(description="first day; empty = open")] = "",
    until: Annotated[dt.date | Literal[""], Query(description="last day; empty = open")] = "",
    visit: Annotated[
        list[Annotated[str, Query(pattern=HEX_ID)]] | None,
        Query(max_length=100, description="only these; none = all"),
    ] = None,
    ticked: Annotated[bool, Query(description="only the visits that are named, even if none is")] = False,
) -> StudyChoice:
    # a form sends what was left open as empty
    return StudyChoice(
        q, protocol or None, since or None, until or None, frozenset(visit or ()) if visit or ticked else None
    )


StudyVisits = Annotated[StudyChoice, Depends(_study_choice)]
"""The visits of a study, as its form and its address say them."""


def address_of(connection: HTTPConnection) -> str:
    """Return the caller's address; behind a proxy uvicorn has already put the forwarded one there."""
    return connection.client.host if connection.client else "unknown"
