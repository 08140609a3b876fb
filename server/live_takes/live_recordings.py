"""Conversion of the log of an ended trial to a recording of its session, byte for byte, with analysis.

Crash-safe: `repair` repeats interrupted steps when the server starts.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, insert, select, update

from sagittal.server import audit
from sagittal.server.errors import NotFound
from sagittal.server.jobs.queue import JobQueue
from sagittal.server.live_takes import live, live_events, live_training
from sagittal.server.results import analyses
from sagittal.server.settings import Settings
from sagittal.server.storage import fs, references, segments
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blobs import Blob, BlobStore
from sagittal.server.storage.schema.live_tables import OPEN_TAKE_STATES, live_take
from sagittal.server.storage.schema.tables import new_id, now, recording, recording_file, user
from sagittal.server.uploads import recordings

log = logging.getLogger(__name__)

CHUNK_BYTES = 1_000_000


@dataclass(frozen=True)
class TakeOpener:
    """The user who opened the trial, in whose name it is stored and analysed."""

    user_id: str
    name: str


def log_path(folder: Path, take_id: str) -> Path:
    """Path of a trial's log before it becomes a recording."""
    return folder / f"{take_id}.log"


def file_name(take: live.LiveTakeRecord) -> str:
    """Name of the recording's only file."""
    return f"live-{take.created_at:%Y%m%dT%H%M%SZ}.sagittal-live"


def keep(db: Database, blobs: BlobStore, queue: JobQueue, path: Path) -> str | None:
    """Store the log of an ended trial as its session's latest recording; idempotent.

    Parameters
    ----------
    path : of the log, named after the trial.

    Returns
    -------
    The recording's id; None without samples or if the session has been erased. The log may then be deleted.
    """
    take_id = path.stem
    try:
        with db.read() as c:
            take = live.get(c, take_id)
        if take.is_open:
            raise RuntimeError(f"live take {take_id} is still {take.state}")
        if take.recording_id is None and path.is_file():
            hello = _hello_of_data(path)
            if hello is not None:
                take = _store(db, blobs, queue, take, path, hello)
            else:
                _set_aside(db, take_id, path)
    except NotFound:
        return None
    return take.recording_id


def repair(db: Database, blobs: BlobStore, settings: Settings, queue: JobQueue) -> list[str]:
    """Store the logs of ended trials after a crash.

    Logs of unknown trials are retained, as the correct database may be missing.

    Returns
    -------
    Ids of open trials with a log.
    """
    fs.make_folder(settings.live)
    _take_in(db, settings)
    waiting = []
    for path in sorted(settings.live.glob("*.log")):
        with db.read() as c:
            state = c.execute(select(live_take.c.state).where(live_take.c.id == path.stem)).scalar()
        if state is None:
            log.warning("the database knows nothing of %s; it is kept (see `sagittal adopt`)", path)
            continue
        if state in OPEN_TAKE_STATES:
            waiting.append(path.stem)
            continue
        try:
            keep(db, blobs, queue, path)
            fs.remove_file(path)
        except Exception:
            # a trial that cannot be stored must not prevent startup; its log remains for the next start
            log.exception("live take %s could not be stored", path.stem)
    return waiting


def _take_in(db: Database, settings: Settings) -> None:
    """Take over logs, videos and trials of web servers that cannot run at the same time.

    These are the unnamed server or, if this one is unnamed, all others.
    """
    left = [one for one in settings.live_folders if one != settings.live and one.is_dir()]
    if settings.node_name:
        left = [one for one in left if one.parent == settings.data_dir]
    if any(any(folder.iterdir()) for folder in left):
        # if two servers start at once, the second finds nothing
        with db.write():
            for folder in left:
                for path in sorted(folder.iterdir()):
                    fs.move_file(path, settings.live / path.name)
                fs.sync_folder(folder)
            fs.sync_folder(settings.live)
    _note_owner(db, settings)


def _note_owner(db: Database, settings: Settings) -> None:
    """Assign trials whose files are here to this server, also after a crash during the move."""
    take_ids = {path.name.partition(".")[0] for path in settings.live.iterdir()}
    node = settings.node_name or None
    strange = live_take.c.id.in_(take_ids) & live_take.c.node.is_distinct_from(node)
    with db.read() as c:
        if c.execute(select(live_take.c.id).where(strange).limit(1)).first() is None:
            return
    with db.write() as c:
        c.execute(update(live_take).where(strange).values(node=node, node_run=None))


def _store(
    db: Database, blobs: BlobStore, queue: JobQueue, take: live.LiveTakeRecord, path: Path, hello: bytes
) -> live.LiveTakeRecord:
    blob = _copy(blobs, take.patient_id, path)
    try:
        with db.write() as c:
            return _publish(c, blobs, queue, take.id, blob, hello)
    except NotFound:
        # erased in the meantime: nothing of it may remain in the trash
        references.discard(db, blobs, take.patient_id, [blob.sha256])
        raise


def _set_aside(db: Database, take_id: str, path: Path) -> None:
    """Retain the log of a trial without readable samples if it contains more than a crash leaves."""
    damage = segments.find_damage(path, segments.count_readable_bytes(path))
    if damage is None:
        return
    original = segments.keep_original(path)
    log.warning("%s: %s Kept as %s.", path.name, damage.sentence, original)
    notice = live_events.own_notice(live_events.DAMAGED, damage.sentence)
    try:
        with db.write() as c:
            live.get(c, take_id)
            live_events.add_event(c, None, take_id, "notice", None, notice)
    except NotFound:
        fs.remove_file(original)  # erased in the meantime
        raise


def _copy(blobs: BlobStore, space: str, path: Path) -> Blob:
    # no limit: these bytes were acknowledged
    with blobs.receive(space) as receiver:
        for chunk in _chunks(path):
            receiver.write(chunk)
        return receiver.keep()


def _chunks(path: Path) -> Iterator[bytes]:
    with path.open("rb") as file:
        while chunk := file.read(CHUNK_BYTES):
            yield chunk


def _hello_of_data(path: Path) -> bytes | None:
    """The hello of a log with at least one batch, otherwise None."""
    hello = None
    for _, record in segments.read_records(path):
        if record.kind == "H":
            hello = record.body
        elif record.kind == "B":
            return hello
    return None


def _publish(
    c: Connection, blobs: BlobStore, queue: JobQueue, take_id: str, blob: Blob, hello: bytes
) -> live.LiveTakeRecord:
    take = live.get(c, take_id)
    if take.recording_id is not None:
        return take
    blobs.require(take.patient_id, blob.sha256)
    recording_id, time = new_id(), now()
    declared: dict[str, Any] = {"sensors": _sensors(hello)}
    if (limits := live_events.read_test_limits(c, take_id)) is not None:
        declared["test_limits"] = limits
    manifest = analyses.complete_manifest(c, take.session_id, declared)
    # alone in its set: files uploaded to this session earlier belong to another trial
    c.execute(
        insert(recording).values(
            id=recording_id, session_id=take.session_id, manifest=manifest, created_at=time
        )
    )
    c.execute(
        insert(recording_file).values(
            recording_id=recording_id,
            name=file_name(take),
            size=blob.size,
            sha256=blob.sha256,
            added_at=time,
        )
    )
    c.execute(update(live_take).where(live_take.c.id == take_id).values(recording_id=recording_id))
    actor = find_opener(c, take)
    live_training.settle_feedback(c, actor, take)
    detail = {"session_id": take.session_id, "take_id": take_id, "sha256": blob.sha256, "size": blob.size}
    audit.record(c, actor, "recording.file_added", "recording", recording_id, detail)
    recordings.inspect(c, queue, actor, take.session_id)
    analyses.submit(c, queue, actor, take.session_id)
    return live.get(c, take_id)


def _sensors(hello: bytes) -> dict[str, Any]:
    """Device → segment, as declared by the tablet."""
    from sagittal.core.formats.live_log import parse_hello

    return {sensor.id: sensor.segment for stream in parse_hello(hello).streams for sensor in stream.sensors}


def find_opener(c: Connection, take: live.LiveTakeRecord) -> TakeOpener | None:
    """User who opened a trial, None if unknown."""
    row = c.execute(select(user.c.id, user.c.name).where(user.c.id == take.opened_by)).first()
    return None if row is None else TakeOpener(row.id, row.name)
