"""Registry of all live trials of this server: tablets, browsers, estimators and events.

One per web process, on its event loop; disk and database access runs in threads. At start it completes
interrupted work, opens the logs of unfinished trials and waits for their tablets.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Coroutine
from typing import Any, Final

from sqlalchemy.exc import SQLAlchemyError

from sagittal.core.formats.live_log import Hello
from sagittal.server import audit
from sagittal.server.errors import NODE_AWAY, Conflict
from sagittal.server.jobs.queue import JobQueue
from sagittal.server.live import protocol
from sagittal.server.live.committer import Committer
from sagittal.server.live.ending import Ending
from sagittal.server.live.intake import TakeEnd
from sagittal.server.live.journal import Journal
from sagittal.server.live.messages import (
    EstimateFailed,
    FeedbackStatus,
    FeedItem,
    FollowTake,
    LogProcessed,
    Picture,
    Report,
    encode_json,
)
from sagittal.server.live.pool import EstimatorPool
from sagittal.server.live.protocol import CloseCode
from sagittal.server.live.recorder import open_recorder
from sagittal.server.live.room import Room
from sagittal.server.live.rows import Rows
from sagittal.server.live.take import ActiveTake, TabletLink, describe_unjoined
from sagittal.server.live_takes import live, live_events, live_recordings
from sagittal.server.nodes.registry import Nodes
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database

log = logging.getLogger(__name__)

TICK_S: Final = 0.1
"""Interval of checks for silence; data are stale after half a second."""
STATE_S: Final = 1.0
"""Interval of sending the running counters."""
GRACE_S: Final = 3.0
"""Time limit for trials that are ending when the server stops; after a kill the next start completes them."""
MIND_S: Final = 2.0
"""Interval at which one of several web servers checks ownership of its trials."""
ABANDONED_S: Final = live.TOKEN_LIFE.total_seconds()
"""A trial without a tablet for this long is ended, since its tokens have expired."""


class Hub:
    """Registry of running trials and their viewers."""

    def __init__(
        self, settings: Settings, db: Database, reviewed: ReviewedAnalyses, queue: JobQueue, nodes: Nodes
    ) -> None:
        self.nodes = nodes
        self._settings, self._db, self._blobs, self._queue = settings, db, reviewed.blobs, queue
        self.journal = Journal(db)
        self.rows = Rows(db, reviewed)
        self.pool = EstimatorPool(settings, self._report, self._begin, self._restarted)
        self._ending = Ending(
            settings, db, reviewed.blobs, queue, self.rows, self.journal, self.pool, self._tell_over
        )
        self._committer = Committer()
        self._takes: dict[str, ActiveTake] = {}
        self._rooms: dict[str, Room] = {}
        self._entering = asyncio.Lock()
        self._ticking: list[asyncio.Task[None]] = []
        self._loop: asyncio.AbstractEventLoop | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def owner(self) -> live.TakeOwner:
        """This web server as the owner of trials."""
        return live.TakeOwner(self.nodes.name, self.nodes.run)

    async def start(self) -> None:
        """Warm up the estimators, complete interrupted work and open unfinished trials."""
        self._loop = asyncio.get_running_loop()
        # warming up takes seconds, with new filters half a minute: do it before the first walk
        self.pool.start()
        self._committer.start()
        self.journal.start()
        waiting = await asyncio.to_thread(
            live_recordings.repair, self._db, self._blobs, self._settings, self._queue
        )
        for take_id in waiting:
            try:
                await self.enter(await asyncio.to_thread(self.rows.take, take_id), None)
            except Exception:
                # its log remains unchanged; other trials and the clinic are unaffected
                log.exception("live take %s could not be opened again", take_id)
        self._ticking = [asyncio.create_task(self._tick())]
        if self.nodes.is_one_of_several:
            self._ticking.append(asyncio.create_task(self._mind_rows()))

    async def stop(self) -> None:
        """Acknowledge received data, disconnect the tablets (they reconnect), end the estimators."""
        for ticking in self._ticking:
            ticking.cancel()
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=GRACE_S)
        for task in tuple(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for take in tuple(self._takes.values()):
            await take.recorder.close()
            if take.tablet is not None:
                take.tablet.shut(CloseCode.GOING_AWAY, "server_stops")
        # the acknowledgements of the data synced by close are still queued in the loop
        await asyncio.sleep(0)
        await self.pool.stop()
        await asyncio.to_thread(self._committer.stop)
        await asyncio.to_thread(self.journal.stop)
        self._takes.clear()

    # the tablet

    async def enter(self, row: live.LiveTakeRecord, hello: Hello | None) -> ActiveTake:
        """The open trial of a tablet, with its log; raises ProtocolError, InputError, NodeAway, NotFound."""
        async with self._entering:
            take = self._takes.get(row.id)
            if take is not None:
                if take.recorder.failure is not None:
                    await take.recorder.reopen()
                return take
            row = await asyncio.to_thread(self.rows.claim, row, self.owner)
            training, earlier = await asyncio.to_thread(self.rows.prepare, row)
            room = self.room(row.session_id)
            room.clear()
            take = ActiveTake(self, row, room, training, earlier)
            path = live_recordings.log_path(self._settings.live, row.id)
            take.recorder = await open_recorder(path, hello, self._committer, take)
            await self._ending.refuse_erased(take)
            take.source = take.recorder.hello.source
            self._takes[row.id] = take
            take.note_growth(take.recorder.size)
        if take.recorder.damage is not None:
            _notify(take, "bad", take.recorder.damage.sentence)
            self._note(take, live_events.DAMAGED, take.recorder.damage.sentence)
        if take.recorder.end is not None:
            self.note_ended(take, take.recorder.end)
        else:
            self.pool.follow(take.id)
        self.tell_state(take)
        return take

    def attach(self, take: ActiveTake, tablet: TabletLink) -> None:
        """Attach a greeted tablet, disconnecting an earlier one."""
        if take.tablet is not None:
            take.tablet.shut(CloseCode.REPLACED, "replaced")
        take.tablet = tablet
        take.tell_stage()
        self.tell_state(take)

    def detach(self, take: ActiveTake, tablet: TabletLink) -> None:
        """Detach a disconnected tablet."""
        if take.tablet is tablet:
            take.tablet = None
            self.tell_state(take)

    # the therapist

    async def command(
        self, actor: audit.Actor | None, session_id: str, name: str, value: Any, at_s: float | None = None
    ) -> dict[str, Any]:
        """Carry out and store a command; return the state; raises Conflict, NodeAway, ServiceError.

        Parameters
        ----------
        at_s : time of a mark, which precedes entering its text; clipped to the latest sample.
        """
        row = await asyncio.to_thread(self.rows.open_take, session_id)
        take = self._takes.get(row.id)
        if take is None:
            self.owner.require(row)
            raise Conflict(
                "no_tablet", "No tablet has joined this recording yet; enter the code on the tablet."
            )
        live_events.check_value(name, value)
        if name in ("start", "stop"):
            if take.tablet is None:
                raise Conflict(
                    "tablet_lost", "The tablet is not connected; wait for it, or end the recording here."
                )
            take.tablet.say(protocol.command("start" if name == "start" else "stop"))
        if name == "undo_mark" and not take.steered.marks:
            raise Conflict("no_mark", "There is no mark to undo.")
        t_s = take.t_s if take.t_s is not None else take.recorder.elapsed_s
        if name == "mark" and at_s is not None and t_s is not None:
            t_s = min(at_s, t_s)
        content = take.steer(name, value, t_s)
        await asyncio.to_thread(self.rows.keep_command, actor, take.id, name, t_s, content)
        self.tell_state(take)
        return take.standing()

    async def close(self, actor: audit.Actor | None, session_id: str) -> live.LiveTakeRecord:
        """End a trial without the tablet; received data become the recording; raises Conflict.

        A trial of an unavailable web server ends as well; that server stores its data when it is back.
        """
        row = await asyncio.to_thread(self.rows.open_take, session_id)
        take = self._takes.get(row.id)
        if take is None:
            end = TakeEnd(0, "", None if self.owner.has(row) else NODE_AWAY)
            over = await asyncio.to_thread(self.rows.end, actor, row.id, "closed", end)
            self._tell_over(over)
            return over
        self._ending.ask(take, actor)
        answer = take.recorder.finish()
        if answer.close is not None:
            self._ending.unask(take)
            raise Conflict(
                answer.reason, "The server cannot write to its disk; free some space and try again."
            )
        await take.over.wait()
        return await asyncio.to_thread(self.rows.take, row.id)

    def drop_from_thread(self, session_ids: list[str]) -> None:
        """Call `drop` from a request thread and wait for it."""
        if self._loop is not None and any(t.session_id in session_ids for t in tuple(self._takes.values())):
            asyncio.run_coroutine_threadsafe(self.drop(session_ids), self._loop).result()

    async def drop(self, session_ids: list[str]) -> None:
        """Release trials whose session is about to be erased."""
        for take in [t for t in self._takes.values() if t.session_id in session_ids]:
            await self._let_go(take)

    async def _let_go(self, take: ActiveTake) -> None:
        self.pool.leave(take.id)
        self._takes.pop(take.id, None)
        await take.recorder.close()
        if take.tablet is not None:
            take.tablet.shut(CloseCode.ENDED, "take_ended")

    # browsers

    def room(self, session_id: str) -> Room:
        """Viewers of a session."""
        return self._rooms.setdefault(session_id, Room())

    def leave(self, session_id: str) -> None:
        """Remove a browser, and the room if it is empty and nothing is streaming."""
        room = self._rooms.get(session_id)
        if room is not None and room.is_empty and self.take_of(session_id) is None:
            del self._rooms[session_id]

    def take_of(self, session_id: str) -> ActiveTake | None:
        """The session's trial with a tablet, None if there is none."""
        return next((t for t in tuple(self._takes.values()) if t.session_id == session_id), None)

    def standing(self, session_id: str) -> dict[str, Any]:
        """State of a session's latest trial for browsers; blocks."""
        take = self.take_of(session_id)
        if take is not None:
            return take.standing()
        row = self.rows.current(session_id)
        state = describe_unjoined(row)
        if row is not None and row.is_open and not self.owner.has(row):
            state["problem"] = NODE_AWAY
        return state

    def tell_state(self, take: ActiveTake) -> None:
        """Send the state of a trial to browsers, unless it has ended (see `_tell_over`)."""
        if self._takes.get(take.id) is take:
            take.room.say("state", encode_json(take.standing()))

    def tell_row(self, row: live.LiveTakeRecord) -> None:
        """Send the state of a trial without a tablet to browsers."""
        take = self._takes.get(row.id)
        if take is None:
            self.room(row.session_id).clear()
            self.room(row.session_id).say("state", encode_json(describe_unjoined(row)))
        else:
            self.tell_state(take)

    # events of the trial

    def note_started(self, take: ActiveTake) -> None:
        """Register the first batch."""
        self._spawn(asyncio.to_thread(self.rows.start, take.id, take.recorder.hello.source))
        self.tell_state(take)

    def note_ended(self, take: ActiveTake, end: TakeEnd) -> None:
        """Register that the end is durable."""
        self._spawn(self._ending.complete(take, end, lambda: self._forget(take)))

    # the estimators

    def _begin(self, take_id: str) -> FollowTake | None:
        take = self._takes.get(take_id)
        return None if take is None else take.begin()

    def _restarted(self, takes: list[str]) -> None:
        for take_id in takes:
            take = self._takes.get(take_id)
            if take is not None:
                _notify(take, "warn", "The live estimate restarts; no recorded data is lost.")

    def _report(self, report: Report) -> None:
        name = getattr(report, "take", "")
        draining = self._ending.draining(name)
        take = draining or self._takes.get(name)
        if take is None:
            return
        match report:
            case Picture() | FeedbackStatus() if draining is not None:
                pass  # the session may have another trial by now
            case LogProcessed():
                take.told.set()
            case Picture():
                if take.estimate != "ok":
                    take.estimate = "ok"
                    self.tell_state(take)
                take.show(report)
            case FeedItem():
                take.tell(report)
            case FeedbackStatus():
                take.room.say("feedback", report.body)
            case EstimateFailed():
                take.estimate = "failed"
                take.told.set()
                _notify(take, "bad", report.message)
                self._note(take, report.code, report.message)
                self.tell_state(take)

    def _note(self, take: ActiveTake, code: str, text: str) -> None:
        """Store a notice of the server with the trial."""
        self.journal.add(take.id, "notice", take.t_s, live_events.own_notice(code, text))

    # threads and tasks

    def _forget(self, take: ActiveTake) -> None:
        self._takes.pop(take.id, None)

    def _tell_over(self, row: live.LiveTakeRecord) -> None:
        self.room(row.session_id).say("state", encode_json(describe_unjoined(row)))
        self.leave(row.session_id)

    async def _tick(self) -> None:
        sent_at = 0.0
        while True:
            await asyncio.sleep(TICK_S)
            now = time.monotonic()
            tell = now - sent_at >= STATE_S
            for take in tuple(self._takes.values()):
                take.look(now)
                if take.tablet is None and now - take.grown_at > ABANDONED_S and not take.over.is_set():
                    self._ending.ask(take, None)
                    take.recorder.finish()
                if tell and take.state == "streaming":
                    self.tell_state(take)
            sent_at = now if tell else sent_at

    async def _mind_rows(self) -> None:
        """Release trials that were erased or taken over elsewhere, and end those ended there."""
        while True:
            await asyncio.sleep(MIND_S)
            try:
                await self._mind_once()
            except SQLAlchemyError:
                continue  # the database is unavailable: continue without changes
            except Exception:
                log.exception("whose the live takes are could not be looked up; trying again")

    async def _mind_once(self) -> None:
        mine = dict(self._takes)
        rows = await asyncio.to_thread(self.rows.takes, list(mine)) if mine else {}
        for take_id, take in mine.items():
            if self._takes.get(take_id) is not take or take.recorder.end is not None:
                continue
            row = rows.get(take_id)
            if row is None or (row.node, row.node_run) != (self.owner.node, self.owner.run):
                await self._let_go(take)
            elif not row.is_open:
                self._ending.ask(take, None)
                take.recorder.finish()

    def _spawn(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._done)

    def _done(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        if not task.cancelled() and task.exception() is not None:
            log.error("a live task failed", exc_info=task.exception())


def _notify(take: ActiveTake, severity: str, text: str) -> None:
    take.room.say("notice", encode_json({"type": "notice", "severity": severity, "text": text}))
