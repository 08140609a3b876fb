"""Videos recorded by the tablet's camera during live trials: chunked upload and storage.

Chunks are numbered and acknowledged when on disk. Repeated chunks are accepted; gaps are rejected, so that
the tablet resumes at the server's position. Chunks are stored in `live/<take>.film` in the record format of a
live log, and erased with the trial's other files. Once the trial is a recording, the video is attached to it
like an uploaded one, aligned by the tablet's clock, which stamps frames and samples alike.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import hashlib
import json
import logging
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from sagittal.core.formats.json_tree import read_json
from sagittal.core.formats.live_log import LATEST_US, MOST_FRAME_BYTES, LogRecord, record
from sagittal.core.formats.live_reader import find_start_us
from sagittal.core.message import Message
from sagittal.server import audit
from sagittal.server.errors import Conflict, NotFound, ServiceError, TooLarge
from sagittal.server.live_takes import live, live_recordings
from sagittal.server.settings import Settings
from sagittal.server.storage import fs, references, segments
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blobs import BlobStore
from sagittal.server.storage.schema.tables import now
from sagittal.server.uploads import receiving, recordings, videos

log = logging.getLogger(__name__)

MOST_PIECE_BYTES: Final = MOST_FRAME_BYTES
"""Maximum size of a chunk; one or two seconds of video take a quarter of it."""


class TokenNotValid(ServiceError):  # noqa: N818 - what the person reads
    """The token matches no such trial, or has expired."""

    status = 401

    def __init__(self) -> None:
        super().__init__(
            "token_not_valid",
            "The token is not valid for this recording, or has expired; pair with a new code.",
        )


@dataclass(frozen=True)
class FilmProgress:
    """Progress of a video upload.

    Parameters
    ----------
    next_piece : number of the next chunk; all below are on disk. limit_bytes : maximum size of the video.
    """

    next_piece: int
    limit_bytes: int


@dataclass
class _OpenFilm:
    log: segments.TakeLog
    pieces: int = 0
    size: int = 0


@dataclass(frozen=True)
class _FilmHead:
    """Header of a video: time of the first frame by the tablet's clock, and consent."""

    began_us: int
    consent_at: dt.datetime


class FilmIntake:
    """Videos being received; one per web process, called from its threads."""

    def __init__(self, settings: Settings, db: Database, blobs: BlobStore) -> None:
        self._settings, self._db, self._blobs = settings, db, blobs
        self._owner = live.TakeOwner(settings.node_name or None)
        self._open: dict[str, _OpenFilm] = {}
        self._lock, self._settling = threading.Lock(), threading.Lock()

    def begin(self, take_id: str, token: str, began_us: int, *, consent: bool) -> FilmProgress:
        """Start a video, or return the progress of one already started.

        Raises
        ------
        TokenNotValid; ServiceError no_consent; DiskFull; NodeAway.
        """
        take = self._admit(take_id, token)
        videos.require_consent(consent)
        if not 0 <= began_us < LATEST_US:
            raise ServiceError("bad_value", "began_us is no time of the tablet's clock in microseconds.")
        with self._lock:
            film = self._find(take_id)
            if film is None:
                receiving.require_room(self._blobs, self._settings, 0)
                head = {"began_us": began_us, "consent_at": now().isoformat()}
                path = film_path(self._settings.live, take_id)
                film = _OpenFilm(segments.create(path, json.dumps(head).encode()))
                self._open[take_id] = film
                with self._db.write() as c:
                    detail = {"take_id": take_id, "consent": True}
                    audit.record(c, None, "video.begun", "session", take.session_id, detail)
            return self._say(film)

    def add(self, take_id: str, token: str, number: int, piece: bytes) -> FilmProgress:
        """Store a chunk durably; an existing one is skipped.

        Raises
        ------
        TokenNotValid; NotFound the film; Conflict film_gap; TooLarge file_too_large; DiskFull.
        """
        self._admit(take_id, token)
        with self._lock:
            film = self._find(take_id)
            if film is None:
                raise NotFound("video of trial", take_id)
            if number > film.pieces:
                raise Conflict(
                    "film_gap",
                    Message(
                        "Piece {number} came, expected {pieces}. Send that first.",
                        number=number,
                        pieces=film.pieces,
                    ),
                )
            if number == film.pieces and piece:
                self._append(film, piece)
            return self._say(film)

    def end(self, take_id: str, token: str) -> bool:
        """Attach a complete video to its trial; return whether there is one, also when repeated.

        Raises
        ------
        TokenNotValid; Conflict take_open: the trial is not a recording yet; retry later.
        """
        take = self._admit(take_id, token)
        with self._lock:
            film = self._open.pop(take_id, None)
            if film is not None:
                film.log.close()
        with self._settling:
            path = film_path(self._settings.live, take_id)
            if path.exists():
                return settle(self._db, self._blobs, self._settings, path)
        with self._db.read() as c:
            return videos.find(c, take.session_id) is not None

    def close(self) -> None:
        """Close all files; uploads resume when the server is back."""
        with self._lock:
            for film in self._open.values():
                film.log.close()
            self._open.clear()

    def _admit(self, take_id: str, token: str) -> live.LiveTakeRecord:
        with self._db.read() as c:
            take = live.by_token(c, take_id, token)
        if take is None:
            raise TokenNotValid
        self._owner.require(take)
        return take

    def _find(self, take_id: str) -> _OpenFilm | None:
        """An open video, or one left by an earlier process."""
        path = film_path(self._settings.live, take_id)
        film = self._open.get(take_id)
        if film is None and path.exists():
            sizes: list[int] = []
            opened = segments.recover(path, lambda one: sizes.append(len(one.body)))
            if opened is not None:
                # the header is not a chunk
                film = _OpenFilm(opened, len(sizes) - 1, sum(sizes[1:]))
                self._open[take_id] = film
        return film

    def _append(self, film: _OpenFilm, piece: bytes) -> None:
        limit = self._settings.max_file_bytes
        if film.size + len(piece) > limit:
            raise TooLarge(
                "file_too_large",
                Message(
                    "A video may have at most {limit:g} MB here and is stopped before that.",
                    limit=limit / 1e6,
                ),
            )
        receiving.require_room(self._blobs, self._settings, len(piece))
        try:
            film.log.append(record("B", piece))
            film.log.sync()
        except OSError:
            with contextlib.suppress(OSError):
                film.log.drop_unsynced()
            raise
        film.pieces += 1
        film.size += len(piece)

    def _say(self, film: _OpenFilm) -> FilmProgress:
        return FilmProgress(film.pieces, self._settings.max_file_bytes)


def film_path(folder: Path, take_id: str) -> Path:
    """Path of a video before it is attached to its trial."""
    return folder / f"{take_id}.film"


def settle(db: Database, blobs: BlobStore, settings: Settings, path: Path) -> bool:
    """Attach a received video to its trial; discard it if there is no recording or frame.

    Parameters
    ----------
    path : of the video, named after the trial, in the folder of its log.

    Returns
    -------
    Whether the video was attached.

    Raises
    ------
    Conflict take_open until the trial has ended and is stored. NotFound the trial: the video is retained,
    since the database may have been restored from a backup.
    """
    take_id = path.stem
    with db.read() as c:
        take = live.get(c, take_id)
        opener = live_recordings.find_opener(c, take)
    stored = take.recording_id is not None
    if take.is_open or (not stored and live_recordings.log_path(path.parent, take_id).exists()):
        raise Conflict(
            "take_open", "The recording has not finished and been stored yet; try again in a moment."
        )
    try:
        attached = stored and _keep(db, blobs, settings, opener, take, path)
        if not attached:
            with db.write() as c:
                audit.record(c, None, "video.discarded", "session", take.session_id, {"take_id": take_id})
    except NotFound:
        attached = False  # erased in the meantime
    fs.remove_file(path)
    return attached


def settle_abandoned(db: Database, blobs: BlobStore, settings: Settings) -> None:
    """Settle videos whose tablet has been absent for longer than tokens of its trial are valid."""
    limit = now().timestamp() - live.TOKEN_LIFE.total_seconds()
    for path in sorted(one for folder in settings.live_folders for one in folder.glob("*.film")):
        try:
            if path.stat().st_mtime < limit:
                settle(db, blobs, settings, path)
        except (Conflict, FileNotFoundError):
            continue
        except NotFound:
            log.warning("the database knows nothing of %s; it is kept", path)
        except Exception:
            log.exception("%s cannot be set beside its take; it will be tried again", path.name)


def _keep(
    db: Database,
    blobs: BlobStore,
    settings: Settings,
    opener: audit.Actor | None,
    take: live.LiveTakeRecord,
    path: Path,
) -> bool:
    head = _read_head(path)
    first = next(_read_pieces(path), b"")
    media_type = videos.find_media_type(first[: videos.BEGINS])
    if head is None or media_type is None:
        return False
    name = f"camera-{take.created_at:%Y%m%dT%H%M%SZ}.{media_type.removeprefix('video/')}"
    with videos.receive_video(db, blobs, settings, opener, take.session_id, name) as film:
        film.consent_at = head.consent_at
        film.offset_s = _find_offset_s(db, blobs, take, head)
        content = hashlib.sha256()
        for piece in _read_pieces(path):
            film.write(piece)
            content.update(piece)
        try:
            film.keep()
        except NotFound:
            # erased in the meantime: nothing of it may remain in the trash
            references.discard(db, blobs, take.patient_id, [content.hexdigest()])
            raise
    return True


def _find_offset_s(
    db: Database, blobs: BlobStore, take: live.LiveTakeRecord, head: _FilmHead
) -> float | None:
    """Video time at trial time 0, by the tablet's clock."""
    if take.recording_id is None:
        return None
    with db.read() as c:
        this = recordings.get(c, take.recording_id)
    origin = find_start_us(_read_stored(blobs, take.patient_id, this))
    offset_s = None if origin is None else (origin - head.began_us) / 1e6
    return offset_s if offset_s is not None and abs(offset_s) <= videos.MOST_OFFSET_S else None


def _read_stored(blobs: BlobStore, space: str, this: recordings.StoredRecording) -> Iterator[LogRecord]:
    for stored in this.files:
        with blobs.open(space, stored.sha256) as file:
            for _, one in segments.read_open_records(file):
                yield one


def _read_pieces(path: Path) -> Iterator[bytes]:
    return (one.body for _, one in segments.read_records(path) if one.kind == "B")


def _read_head(path: Path) -> _FilmHead | None:
    for _, one in segments.read_records(path):
        head: Any = read_json(one.body) if one.kind == "H" else None
        with contextlib.suppress(TypeError, KeyError, ValueError):
            return _FilmHead(int(head["began_us"]), dt.datetime.fromisoformat(head["consent_at"]))
        break
    return None
