"""Typed dependencies through which endpoints access the running application.

The dependencies are asynchronous: FastAPI runs each synchronous one in a thread, and on a busy machine a page
would wait for all of them in turn.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from typing import Annotated, Any, Literal, cast

from fastapi import Depends, Path, Query
from starlette import datastructures
from starlette.requests import HTTPConnection

from sagittal.core.frames import Protocol
from sagittal.server.auth.sessions import Logins
from sagittal.server.auth.throttle import Throttle
from sagittal.server.downloads.studies import StudyChoice
from sagittal.server.jobs.feed import JobFeed
from sagittal.server.jobs.queue import JobQueue
from sagittal.server.live.hub import Hub
from sagittal.server.live_takes.films import FilmIntake
from sagittal.server.metrics import RequestMetrics
from sagittal.server.nodes.registry import Nodes
from sagittal.server.processes.supervisor import Workers
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blobs import BlobStore
from sagittal.server.storage.readiness import Readiness
from sagittal.server.trail import AuditTrail


class State(datastructures.State):
    """Open resources of the web process (`app.state`), set by `create_app` and the lifespan.

    Lower-level packages read single attributes of `app.state` and declare their types themselves.
    """

    settings: Settings
    metrics: RequestMetrics
    db: Database
    blobs: BlobStore
    reviewed: ReviewedAnalyses
    logins: Logins
    trail: AuditTrail
    throttle: Throttle
    queue: JobQueue
    feed: JobFeed
    films: FilmIntake
    nodes: Nodes
    hub: Hub
    readiness: Readiness
    workers: Workers
    """Only if `sagittal serve` started them."""


def state_of(connection: HTTPConnection) -> State:
    """Return the state of the application that serves a request."""
    return cast("State", connection.app.state)


def _part(choose: Callable[[State], object]) -> Any:
    """Dependency that returns one attribute of the state."""

    async def take(connection: HTTPConnection) -> object:
        return choose(state_of(connection))

    return Depends(take)


Config = Annotated[Settings, _part(lambda state: state.settings)]
Db = Annotated[Database, _part(lambda state: state.db)]
Blobs = Annotated[BlobStore, _part(lambda state: state.blobs)]
Reviewed = Annotated[ReviewedAnalyses, _part(lambda state: state.reviewed)]
Queue = Annotated[JobQueue, _part(lambda state: state.queue)]
Feed = Annotated[JobFeed, _part(lambda state: state.feed)]
LiveHub = Annotated[Hub, _part(lambda state: state.hub)]
Films = Annotated[FilmIntake, _part(lambda state: state.films)]
OpenTrail = Annotated[AuditTrail, _part(lambda state: state.trail)]
OpenLogins = Annotated[Logins, _part(lambda state: state.logins)]
Failures = Annotated[Throttle, _part(lambda state: state.throttle)]

HEX_ID = r"^[0-9a-f]{32}$"
"""Format of an identifier."""
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
    # forms submit empty strings for fields left blank
    return StudyChoice(
        q, protocol or None, since or None, until or None, frozenset(visit or ()) if visit or ticked else None
    )


StudyVisits = Annotated[StudyChoice, Depends(_study_choice)]
"""The visits of a study, from its form or URL."""


def address_of(connection: HTTPConnection) -> str:
    """Return the client's address; uvicorn has already resolved forwarded addresses of proxies."""
    return connection.client.host if connection.client else "unknown"
