"""Jobs of the workers, with live updates."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from typing import Annotated, cast

from fastapi import APIRouter, Query, Request
from pydantic import TypeAdapter
from starlette.concurrency import run_in_threadpool
from starlette.responses import StreamingResponse

from sagittal.server import context
from sagittal.server.auth.access import find_end, require, wait_for_end
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import jobs
from sagittal.server.context import Db, Id, OpenTrail
from sagittal.server.jobs.feed import JobFeed
from sagittal.server.jobs.queue import JobView

router = APIRouter(prefix="/jobs", tags=["jobs"])
KEEP_ALIVE_S = 15.0
"""Proxies close connections that are silent for longer (nginx: 60 s)."""
RETRY_MS = 2000
"""Delay before a browser reconnects."""

Reader = Annotated[Identity, require(Action.READ_JOB)]
_JOB = TypeAdapter(JobView)


@router.get("", response_model=list[jobs.ListedJob])
def list_jobs(
    db: Db,
    trail: OpenTrail,
    user: Reader,
    active: Annotated[bool, Query(description="only queued and running ones")] = False,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> list[jobs.ListedJob]:
    """List jobs, newest first."""
    with db.read() as c:
        rows = jobs.list_jobs(c, user, active_only=active, limit=limit)
    trail.record_watched(user, "job.listed", "job", None)
    return rows


@router.get("/{job_id}", response_model=jobs.ListedJob)
def read_job(job_id: Id, db: Db, trail: OpenTrail, user: Reader) -> jobs.ListedJob:
    """Progress of a job, or the reason of its failure."""
    with db.read() as c:
        row = jobs.get(c, job_id)
    trail.record_watched(user, "job.opened", "job", job_id)
    return row


@router.get(
    "/{job_id}/events",
    response_class=StreamingResponse,
    responses={
        200: {"description": "The job now and after every change", "content": {"text/event-stream": {}}}
    },
)
async def watch_job(
    job_id: Id, request: Request, db: Db, feed: context.Feed, user: Reader
) -> StreamingResponse:
    """Stream a job as server-sent events, each a Job as JSON; the stream ends with the job."""

    def check() -> None:
        with db.read() as c:
            jobs.get(c, job_id)

    await run_in_threadpool(check)
    events = _events(feed, job_id, lambda: find_end(request))
    return StreamingResponse(events, media_type="text/event-stream", headers={"X-Accel-Buffering": "no"})


@router.post("/{job_id}/cancel", status_code=202, response_model=JobView)
def cancel_job(
    job_id: Id,
    db: Db,
    queue: context.Queue,
    user: Annotated[Identity, require(Action.CANCEL_JOB)],
) -> JobView:
    """Request cancellation of a job, which takes effect within two seconds; no effect if finished."""
    with db.write() as c:
        return jobs.cancel(c, queue, user, job_id)


async def _events(feed: JobFeed, job_id: str, find_end: Callable[[], str | None]) -> AsyncIterator[str]:
    """Format updates of a job as events, with comments in between so that proxies keep the connection open.

    Parameters
    ----------
    find_end : returns why the stream must end, None to continue; called every `CHECK_EVERY_S` regardless of
        updates.
    """
    watch = cast("AsyncGenerator[JobView, None]", feed.watch(job_id))
    async with contextlib.aclosing(watch) as views:
        pending = asyncio.ensure_future(anext(views, None))
        over = asyncio.create_task(wait_for_end(find_end))
        try:
            yield f"retry: {RETRY_MS}\n\n"
            while True:
                done, _ = await asyncio.wait(
                    {pending, over}, timeout=KEEP_ALIVE_S, return_when=asyncio.FIRST_COMPLETED
                )
                if over in done:
                    return
                if not done:
                    yield ": waiting\n\n"
                    continue
                view = pending.result()
                if view is None:
                    return
                yield f"data: {_JOB.dump_json(view).decode()}\n\n"
                pending = asyncio.ensure_future(anext(views, None))
        finally:
            over.cancel()
            pending.cancel()
            await asyncio.gather(over, pending, return_exceptions=True)
