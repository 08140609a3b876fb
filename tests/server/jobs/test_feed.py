from __future__ import annotations

import asyncio
from collections.abc import Iterator

import pytest
from sqlalchemy import delete

from sagittal.server.jobs.feed import JobFeed
from sagittal.server.jobs.queue import JobView
from sagittal.server.jobs.table import TableQueue
from sagittal.server.storage.db import Database, Source
from sagittal.server.storage.schema.tables import job


@pytest.fixture
def db(source: Source) -> Iterator[Database]:
    opened = Database(source)
    yield opened
    opened.close()


def submit(db: Database, queue: TableQueue) -> JobView:
    with db.write() as c:
        return queue.submit(c, key="a", kind="k", params={})


def test_two_watchers_see_every_state_and_the_end(db: Database) -> None:
    queue = TableQueue(db, 15.0)
    feed = JobFeed(db)
    observations: list[list[str]] = [[], []]

    async def watch(user: int, job_id: str) -> None:
        async for view in feed.watch(job_id):
            observations[user].append(view.state)

    async def story() -> None:
        view = submit(db, queue)
        watchers = [asyncio.create_task(watch(i, view.id)) for i in range(2)]
        await reached(lambda: all(s == ["queued"] for s in observations))
        claim = queue.claim("w", ("k",))
        assert claim is not None
        await reached(lambda: all(s[-1] == "running" for s in observations))
        queue.progress(claim, "angles", 0.5)
        await reached(lambda: all(len(s) == 3 for s in observations))
        queue.heartbeat(claim)  # changes nothing that people see
        queue.finish(claim, lambda c: None)
        await asyncio.gather(*watchers)
        late = [v.state async for v in feed.watch(view.id)]
        assert late == ["done"]

    asyncio.run(asyncio.wait_for(story(), 60))
    assert observations == [["queued", "running", "running", "done"]] * 2


def test_a_watch_ends_when_the_job_is_erased_unknown_or_the_feed_closes(db: Database) -> None:
    queue = TableQueue(db, 15.0)
    feed = JobFeed(db)

    async def count(job_id: str) -> int:
        return len([v async for v in feed.watch(job_id)])

    async def story() -> None:
        assert await count("0" * 32) == 0
        view = submit(db, queue)
        for end in ("erase", "close"):
            seen: list[JobView] = []
            if end == "close":
                view = submit(db, queue)
            watcher = asyncio.create_task(collect(feed, view.id, seen))
            await reached(lambda seen=seen: len(seen) == 1)
            if end == "erase":
                with db.write() as c:
                    c.execute(delete(job))
            else:
                feed.close()
            await watcher

    asyncio.run(asyncio.wait_for(story(), 60))


async def collect(feed: JobFeed, job_id: str, observations: list[JobView]) -> None:
    async for view in feed.watch(job_id):
        observations.append(view)  # noqa: PERF401 - filled while it is watched


async def reached(look: object) -> None:
    assert callable(look)
    while not look():
        await asyncio.sleep(0.02)
