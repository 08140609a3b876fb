"""All live takes of this server: who streams, who watches, who estimates, and what is kept of it.

One per web process, on its event loop. Whatever waits for disk or database does so in a thread. At start it
finishes what a crash left, opens the logs of takes that are still open and waits for their tablets.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Coroutine
from typing import Any, Final

import msgspec

from core.formats.live_log import Hello
from server import audit
from server.jobs.queue import JobQueue
from server.live import protocol
from server.live.committer import Committer
from server.live.intake import Ended
from server.live.journal import Journal
from server.live.messages import Begin, Broken, Item, Picture, Report, Standing, Through
from server.live.pool import Pool
from server.live.protocol import Close
from server.live.recorder import open_recorder
from server.live.room import Room
from server.live.take import Line, LiveTake
from server.services import live, live_recordings
from server.services.errors import Conflict, NotFound, ServiceError
from server.services.live_training import Training, training_of
from server.settings import Settings
from server.storage import fs
from server.storage.blobs import BlobStore
from server.storage.db import Database

log = logging.getLogger(__name__)

TICK_S: Final = 0.1
"""How often silence is looked for; staleness is half a second."""
STATE_S: Final = 1.0
"""How often the running counters are told."""
GRACE_S: Final = 3.0
"""Time a take that is just ending has when the server stops; after a kill the next start does the rest."""
DRAIN_S: Final = 10.0
"""Time the estimator has for what it has not told when a take ends."""
AGAIN_S: Final = 30.0
"""Pause before a take that could not be stored (disk full) is tried again."""


class Hub:
    """The registry."""

    def __init__(self, settings: Settings, db: Database, blobs: BlobStore, queue: JobQueue) -> None:
        self._settings, self._db, self._blobs, self._queue = settings, db, blobs, queue
        self.journal = Journal(db)
        self.pool = Pool(settings, self._report, self._begin, self._restarted)
        self._committer = Committer()
        self._takes: dict[str, LiveTake] = {}
        self._draining: dict[str, LiveTake] = {}
        self._rooms: dict[str, Room] = {}
        self._closing: dict[str, audit.Actor | None] = {}
        self._entering = asyncio.Lock()
        self._ticking: asyncio.Task[None] | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    async def start(self) -> None:
        """Finish what a crash left and open the takes that are still open."""
        self._loop = asyncio.get_running_loop()
        self._committer.start()
        self.journal.start()
        waiting = await asyncio.to_thread(
            live_recordings.repair, self._db, self._blobs, self._settings, self._queue
        )
        for take_id in waiting:
            try:
                await self.enter(await asyncio.to_thread(self._row, take_id), None)
            except Exception:
                # its log stays as it is; the other takes and the clinic go on
                log.exception("live take %s could not be opened again", take_id)
        self._ticking = asyncio.create_task(self._tick())

    async def stop(self) -> None:
        """Acknowledge what has come, send the tablets away (they come back), end the estimators."""
        if self._ticking is not None:
            self._ticking.cancel()
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=GRACE_S)
        for task in tuple(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for take in tuple(self._takes.values()):
            await take.recorder.close()
            if take.tablet is not None:
                take.tablet.shut(Close.GOING_AWAY, "server_stops")
        # the acknowledgements of what close has just synced are on their way through the loop
        await asyncio.sleep(0)
        await self.pool.stop()
        await asyncio.to_thread(self._committer.stop)
        await asyncio.to_thread(self.journal.stop)
        self._takes.clear()

    # the tablet

    def admit(self, take_id: str, token: str) -> live.Take | None:
        """The take a token opens, over or not; blocks."""
        with self._db.read() as c:
            return live.by_token(c, take_id, token)

    async def enter(self, row: live.Take, hello: Hello | None) -> LiveTake:
        """The open take of a tablet, with its log; raises ProtocolError, InputError."""
        async with self._entering:
            take = self._takes.get(row.id)
            if take is not None:
                if take.recorder.failure is not None:
                    await take.recorder.reopen()
                return take
            training, earlier = await asyncio.to_thread(self._prepared, row)
            room = self.room(row.session_id)
            room.clear()
            take = LiveTake(self, row, room, training, earlier)
            path = live_recordings.log_path(self._settings.live, row.id)
            take.recorder = await open_recorder(path, hello, self._committer, take)
            take.source = take.recorder.hello.source
            self._takes[row.id] = take
            take.grown(take.recorder.size)
        if take.recorder.end is not None:
            self.note_ended(take, take.recorder.end)
        else:
            self.pool.follow(take.id)
        self.tell_state(take)
        return take

    def attach(self, take: LiveTake, tablet: Line) -> None:
        """A tablet has been greeted; one that was there before is sent away."""
        if take.tablet is not None:
            take.tablet.shut(Close.REPLACED, "replaced")
        take.tablet = tablet
        take.tell_stage()
        self.tell_state(take)

    def detach(self, take: LiveTake, tablet: Line) -> None:
        """A tablet has gone."""
        if take.tablet is tablet:
            take.tablet = None
            self.tell_state(take)

    # the therapist

    async def command(
        self, actor: audit.Actor | None, session_id: str, name: str, value: Any, at_s: float | None = None
    ) -> dict[str, Any]:
        """Carry a command out, keep it, and return the state; raises Conflict, ServiceError bad_value.

        Parameters
        ----------
        at_s : the moment a mark means, which is before its words are written; never after the newest sample.
        """
        row = await asyncio.to_thread(self._open_row, session_id)
        take = self._takes.get(row.id)
        if take is None:
            raise Conflict("no_tablet", "No tablet has joined this take yet; enter its code on the tablet.")
        _check_value(name, value)
        if name in ("start", "stop"):
            if take.tablet is None:
                raise Conflict(
                    "tablet_lost", "The tablet is not connected; wait for it, or end the take here."
                )
            take.tablet.say(protocol.command("start" if name == "start" else "stop"))
        if name == "undo_mark" and not take.steered.marks:
            raise Conflict("no_mark", "There is no mark to undo.")
        t_s = take.t_s
        if name == "mark" and at_s is not None and t_s is not None:
            t_s = min(at_s, t_s)
        content = take.steer(name, value, t_s)
        await asyncio.to_thread(self._keep_command, actor, take.id, name, t_s, content)
        self.tell_state(take)
        return take.standing()

    async def close(self, actor: audit.Actor | None, session_id: str) -> live.Take:
        """End a take without the tablet; what has come becomes the recording; raises Conflict."""
        row = await asyncio.to_thread(self._open_row, session_id)
        take = self._takes.get(row.id)
        if take is None:
            over = await asyncio.to_thread(self._end, actor, row.id, "closed", Ended(0, ""))
            self._tell_over(over)
            return over
        self._closing[take.id] = actor
        answer = take.recorder.finish()
        if answer.close is not None:
            del self._closing[take.id]
            raise Conflict(answer.reason, "The server's disk refuses; make room and try again.")
        await take.over.wait()
        return await asyncio.to_thread(self._row, row.id)

    def drop_from_thread(self, session_ids: list[str]) -> None:
        """As `drop`, from a thread that answers a request; blocks until done."""
        if self._loop is not None and any(t.session_id in session_ids for t in tuple(self._takes.values())):
            asyncio.run_coroutine_threadsafe(self.drop(session_ids), self._loop).result()

    async def drop(self, session_ids: list[str]) -> None:
        """Let go of takes whose session is about to be erased."""
        for take in [t for t in self._takes.values() if t.session_id in session_ids]:
            await self._let_go(take)
            if take.tablet is not None:
                take.tablet.shut(Close.ENDED, "take_ended")

    # browsers

    def room(self, session_id: str) -> Room:
        """Who watches a session."""
        return self._rooms.setdefault(session_id, Room())

    def leave(self, session_id: str) -> None:
        """A browser has gone; forget the room when it was the last and nothing streams."""
        room = self._rooms.get(session_id)
        if room is not None and room.is_empty and self.take_of(session_id) is None:
            del self._rooms[session_id]

    def take_of(self, session_id: str) -> LiveTake | None:
        """The session's take that a tablet has joined, None when there is none."""
        return next((t for t in self._takes.values() if t.session_id == session_id), None)

    def standing(self, session_id: str) -> dict[str, Any]:
        """The state of a session's newest take for the browsers; blocks."""
        take = self.take_of(session_id)
        if take is not None:
            return take.standing()
        with self._db.read() as c:
            row = live.current(c, session_id)
        return _standing(row)

    def tell_state(self, take: LiveTake) -> None:
        """Tell the browsers where a take stands; of one that is over `_tell_over` has the last word."""
        if self._takes.get(take.id) is take:
            take.room.say("state", msgspec.json.encode(take.standing()))

    def tell_row(self, row: live.Take) -> None:
        """Tell the browsers of a take that no tablet has joined yet."""
        take = self._takes.get(row.id)
        if take is None:
            self.room(row.session_id).clear()
            self.room(row.session_id).say("state", msgspec.json.encode(_standing(row)))
            self.pool.start()
        else:
            self.tell_state(take)

    # what the take tells

    def note_started(self, take: LiveTake) -> None:
        """The first batch has come."""
        self._spawn(self._started(take))
        self.tell_state(take)

    def note_ended(self, take: LiveTake, end: Ended) -> None:
        """The end is durable."""
        self._spawn(self._complete(take, end))

    # the estimators

    def _begin(self, take_id: str) -> Begin | None:
        take = self._takes.get(take_id)
        return None if take is None else take.begin()

    def _restarted(self, takes: list[str]) -> None:
        for take_id in takes:
            take = self._takes.get(take_id)
            if take is not None:
                _notify(take, "warn", "The live estimate starts again; nothing recorded is lost.")

    def _report(self, report: Report) -> None:
        name = getattr(report, "take", "")
        take = self._takes.get(name) or self._draining.get(name)
        if take is None:
            return
        match report:
            case Picture() | Standing() if name in self._draining:
                pass  # the session may have another take by now
            case Through():
                take.told.set()
            case Picture():
                take.estimate = "ok"
                take.show(report)
            case Item():
                take.tell(report)
            case Standing():
                take.room.say("feedback", report.body)
            case Broken():
                take.estimate = "failed"
                take.told.set()
                _notify(take, "bad", report.message)
                self.journal.add(
                    take.id,
                    "notice",
                    take.t_s,
                    {"code": report.code, "text": report.message, "severity": "bad"},
                )
                self.tell_state(take)

    # threads and tasks

    def _row(self, take_id: str) -> live.Take:
        with self._db.read() as c:
            return live.get(c, take_id)

    def _open_row(self, session_id: str) -> live.Take:
        with self._db.read() as c:
            return live.require_open(c, session_id)

    def _prepared(self, row: live.Take) -> tuple[Training, list[live.LiveEvent]]:
        with self._db.write() as c:
            return training_of(c, self._blobs, row), live.events(c, row.id)

    def _keep_command(
        self, actor: audit.Actor | None, take_id: str, kind: str, t_s: float | None, content: object
    ) -> None:
        with self._db.write() as c:
            live.add_event(c, actor, take_id, kind, t_s, content)

    def _end(self, actor: audit.Actor | None, take_id: str, state: str, end: Ended) -> live.Take:
        self.journal.write()
        with self._db.write() as c:
            return live.end(
                c, actor, take_id, state, count=end.count, sha256=end.sha256 or None, problem=end.problem
            )

    async def _started(self, take: LiveTake) -> None:
        def write() -> None:
            with self._db.write() as c:
                live.started(c, take.id, take.recorder.hello.source, take.training.prescription_id)

        with contextlib.suppress(NotFound):
            await asyncio.to_thread(write)

    async def _complete(self, take: LiveTake, end: Ended) -> None:
        """The steps after the end; each may be the last before a crash (services/live_recordings.py)."""
        by_us = take.id in self._closing
        actor = self._closing.pop(take.id, None)
        state = "closed" if by_us else "finished"
        try:
            with contextlib.suppress(NotFound):
                await asyncio.to_thread(self._end, actor, take.id, state, end)
            self._takes.pop(take.id, None)
            self._draining[take.id] = take
            await take.recorder.close()
            take.problem = end.problem
            take.recording_id = await self._store(take.id)
            take.stored = True
            if take.tablet is not None:
                if take.recording_id is not None:
                    take.tablet.say(protocol.finished(take.recording_id, take.problem))
                if by_us or take.recording_id is None:
                    take.tablet.shut(Close.ENDED, "take_ended")
            with contextlib.suppress(NotFound):
                self._tell_over(await asyncio.to_thread(self._row, take.id))
        finally:
            take.over.set()
            await self._drain(take)

    async def _store(self, take_id: str) -> str | None:
        """Store until it works: the log holds acknowledged samples."""
        while True:
            try:
                return await asyncio.to_thread(
                    live_recordings.keep, self._db, self._blobs, self._settings, self._queue, take_id
                )
            except Exception:
                log.exception("live take %s is not stored yet; trying again", take_id)
            await asyncio.sleep(AGAIN_S)

    async def _drain(self, take: LiveTake) -> None:
        """Hear the estimator out: the last strides and cues are still on their way."""
        if self.pool.follows(take.id) and take.estimate == "ok":
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(DRAIN_S):
                    await take.told.wait()
        self.pool.leave(take.id)
        self._draining.pop(take.id, None)
        if take.stored:
            path = live_recordings.log_path(self._settings.live, take.id)
            await asyncio.to_thread(fs.remove_file, path)

    async def _let_go(self, take: LiveTake) -> None:
        self.pool.leave(take.id)
        self._takes.pop(take.id, None)
        await take.recorder.close()

    def _tell_over(self, row: live.Take) -> None:
        self.room(row.session_id).say("state", msgspec.json.encode(_standing(row)))
        self.leave(row.session_id)

    async def _tick(self) -> None:
        told = 0.0
        while True:
            await asyncio.sleep(TICK_S)
            now = time.monotonic()
            tell = now - told >= STATE_S
            for take in tuple(self._takes.values()):
                take.look(now)
                if tell and take.state == "streaming":
                    self.tell_state(take)
            told = now if tell else told

    def _spawn(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._done)

    def _done(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        if not task.cancelled() and task.exception() is not None:
            log.error("a live task failed", exc_info=task.exception())


def _standing(row: live.Take | None) -> dict[str, Any]:
    return {
        "type": "state",
        "take": None if row is None else row.id,
        "state": "none" if row is None else row.state,
        "tablet": "none",
        "source": None if row is None else row.source,
        "count": None if row is None else row.count,
        "elapsed_s": None,
        "marks": [],
        "ghost": None,
        "stale": False,
        "estimate": "ok",
        "recording": None if row is None else row.recording_id,
        "problem": None if row is None else row.problem,
    }


def _notify(take: LiveTake, severity: str, text: str) -> None:
    take.room.say("notice", msgspec.json.encode({"type": "notice", "severity": severity, "text": text}))


def _check_value(name: str, value: Any) -> None:
    """Refuse what the estimator could not obey."""
    if name in ("feedback", "pause"):
        ok, expected = isinstance(value, bool), "true or false"
    elif name == "level":
        ok = isinstance(value, int) and not isinstance(value, bool) and abs(value) <= 100
        expected = "a whole number of steps, + easier, − harder"
    elif name in ("mark", "ghost"):
        ok, expected = (
            value is None or (isinstance(value, str) and len(value) <= 200),
            "a short text or nothing",
        )
    else:
        ok, expected = value is None, "nothing"
    if not ok:
        raise ServiceError("bad_value", f"The value of the command {name} is not {expected}.")
