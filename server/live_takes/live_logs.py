"""Logs of all web servers: their content, whether the database knows them, and adoption of unknown ones.

A log may lack a row after the database was restored from a backup. It is retained until it is adopted or
removed manually.
"""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import Connection, insert, select

from sagittal.core.errors import InputError
from sagittal.core.formats.live_log import parse_hello, read_batch_header
from sagittal.core.message import Message
from sagittal.server import audit
from sagittal.server.clinic import sessions
from sagittal.server.errors import Conflict, NotFound
from sagittal.server.jobs.queue import JobQueue
from sagittal.server.live_takes import live_recordings
from sagittal.server.settings import Settings
from sagittal.server.storage import fs, segments
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blobs import BlobStore
from sagittal.server.storage.schema.live_tables import live_take

_ID = re.compile(r"[0-9a-f]{32}")


@dataclass(frozen=True)
class LiveLog:
    """One log in `live/`.

    Parameters
    ----------
    known : whether its trial is in the database. written_at : time of the last batch. batches : complete
        ones.
    span_s : time between the first and the last of them, None with fewer than two. sensors : their number.
    damage : unreadable data after the batches, None = none.
    """

    take_id: str
    path: Path
    known: bool
    written_at: dt.datetime
    size: int
    source: str | None
    sensors: int
    batches: int
    span_s: float | None
    damage: segments.Damage | None

    @property
    def words(self) -> str:
        """Description of its content."""
        long = "" if self.span_s is None else f", {self.span_s:.0f} s"
        return f"{self.written_at:%Y-%m-%d %H:%M}Z, {self.sensors} sensors, {self.batches} batches{long}"


def list_logs(c: Connection, settings: Settings) -> Iterator[LiveLog]:
    """All logs in `live/`, by name; one that disappears meanwhile (its trial ended) is skipped."""
    for path in _list_files(settings, "*.log"):
        row = c.execute(select(live_take.c.id).where(live_take.c.id == path.stem)).first()
        try:
            yield read_log(path, is_known=row is not None)
        except FileNotFoundError:
            continue


def list_originals(settings: Settings) -> list[Path]:
    """Retained copies of damaged logs."""
    return _list_files(settings, "*.damaged")


def _list_files(settings: Settings, pattern: str) -> list[Path]:
    return sorted(path for folder in settings.live_folders for path in folder.glob(pattern))


def read_log(path: Path, *, is_known: bool) -> LiveLog:
    """Scan one log; raises OSError."""
    status = path.stat()
    source, sensors, batches, size, sent = None, 0, 0, 0, []
    for size, one in segments.read_records(path):  # noqa: B007 - the last one is used
        try:
            if one.kind == "H":
                hello = parse_hello(one.body)
                source, sensors = hello.source, sum(len(s.sensors) for s in hello.streams)
            elif one.kind == "B":
                batches += 1
                sent.append(read_batch_header(one.body).sent_us)
        except InputError:
            break
    return LiveLog(
        path.stem,
        path,
        is_known,
        dt.datetime.fromtimestamp(status.st_mtime, dt.UTC),
        status.st_size,
        source,
        sensors,
        batches,
        (max(sent) - min(sent)) / 1e6 if len(sent) > 1 else None,
        segments.find_damage(path, size),
    )


def adopt(
    db: Database,
    blobs: BlobStore,
    settings: Settings,
    queue: JobQueue,
    actor: audit.Actor | None,
    take_id: str,
    session_id: str,
) -> str:
    """Turn a log unknown to the database into an analysed recording of a session; return its id.

    Raises
    ------
    NotFound no such log or session; Conflict `take_known`, `take_empty`.
    """
    if not _ID.fullmatch(take_id):
        raise NotFound("live log", take_id)
    path = next(iter(_list_files(settings, f"{take_id}.log")), None)
    if path is None:
        raise NotFound("live log", take_id)
    log = read_log(path, is_known=False)
    if not log.batches:
        raise Conflict(
            "take_empty",
            Message("{name} has no readable sample; it was left unchanged.", name=path.name),
        )
    with db.write() as c:
        sessions.get(c, session_id)
        if c.execute(select(live_take.c.id).where(live_take.c.id == take_id)).first():
            raise Conflict(
                "take_known", Message("Recording {take_id} already belongs to a visit.", take_id=take_id)
            )
        c.execute(
            insert(live_take).values(
                id=take_id,
                session_id=session_id,
                state="closed",
                source=log.source,
                count=log.batches,
                opened_by=actor.user_id if actor else None,
                created_at=log.written_at,
                finished_at=log.written_at,
            )
        )
        detail = {"take_id": take_id, "count": log.batches}
        audit.record(c, actor, "live.adopted", "session", session_id, detail)
    recording_id = live_recordings.keep(db, blobs, queue, path)
    if recording_id is None:
        raise NotFound("session", session_id)
    fs.remove_file(path)
    return recording_id
