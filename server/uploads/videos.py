"""Video of a trial: shown next to the avatar, never analysed, and not part of reports.

A video is accepted only if the user who adds it confirms the patient's consent, which is recorded with it. It
is deleted with its session and patient. A session has one video; another replaces it.
"""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from math import isfinite
from typing import Final

from sqlalchemy import Connection, delete, insert, select, update

from sagittal.core.message import Message
from sagittal.server import audit
from sagittal.server.clinic import sessions
from sagittal.server.errors import NotFound, ServiceError
from sagittal.server.storage.files.blobs import Blob, BlobStore
from sagittal.server.storage.schema.tables import now, session_video
from sagittal.server.uploads.receiving import receive
from sagittal.server.uploads.recordings import RecordedFile

BEGINS: Final = 12
"""Number of initial bytes that identify the type of a file."""

MOST_OFFSET_S: Final = 24 * 3600.0


@dataclass(frozen=True)
class SessionVideo:
    """The video of a session.

    Parameters
    ----------
    offset_s : video time at trial time 0; None until aligned.
    consent_by, consent_at : user who confirmed the patient's consent, and time.
    """

    session_id: str
    name: str
    media_type: str
    size: int
    sha256: str
    offset_s: float | None
    consent_by: str | None
    consent_at: dt.datetime


def find(c: Connection, session_id: str) -> SessionVideo | None:
    """Video of a session, None without one."""
    row = c.execute(select(session_video).where(session_video.c.session_id == session_id)).first()
    return None if row is None else SessionVideo(**row._asdict())


def get(c: Connection, session_id: str) -> SessionVideo:
    """Video of a session; raises NotFound for the session and for its video."""
    sessions.get(c, session_id)
    video = find(c, session_id)
    if video is None:
        raise NotFound("video of visit", session_id)
    return video


def find_stored(c: Connection, blobs: BlobStore, session_id: str) -> tuple[SessionVideo, str]:
    """A video and the space of its blob; raises NotFound, IntegrityError if missing."""
    video = get(c, session_id)
    space = sessions.get(c, session_id).patient_id
    blobs.require(space, video.sha256)
    return video, space


def align(c: Connection, actor: audit.Actor | None, session_id: str, offset_s: float | None) -> SessionVideo:
    """Set the video time at trial time 0, None = unknown; raises NotFound, bad_value."""
    get(c, session_id)
    if offset_s is not None and not (isfinite(offset_s) and abs(offset_s) <= MOST_OFFSET_S):
        raise ServiceError(
            "bad_value",
            Message(
                "The offset is {offset_s} s; expected at most one day in either direction.", offset_s=offset_s
            ),
        )
    c.execute(update(session_video).where(session_video.c.session_id == session_id).values(offset_s=offset_s))
    audit.record(c, actor, "video.aligned", "session", session_id, {"offset_s": offset_s})
    return get(c, session_id)


def remove(c: Connection, actor: audit.Actor | None, session_id: str) -> None:
    """Remove the video; raises NotFound."""
    get(c, session_id)
    c.execute(delete(session_video).where(session_video.c.session_id == session_id))
    audit.record(c, actor, "video.removed", "session", session_id)


def require_consent(consent: bool) -> None:
    """Raise ServiceError no_consent unless the patient's consent is confirmed."""
    if not consent:
        raise ServiceError(
            "no_consent",
            "A video is stored only with the person's consent. Obtain consent and confirm it with the "
            "upload.",
        )


def find_media_type(begins: bytes) -> str | None:
    """Media type from the first bytes: MP4 and QuickTime have "ftyp", WebM is EBML; otherwise None."""
    if begins[4:8] == b"ftyp":
        return "video/quicktime" if begins[8:12] == b"qt  " else "video/mp4"
    return "video/webm" if begins[:4] == b"\x1a\x45\xdf\xa3" else None


class receive_video(receive):  # noqa: N801 - as `receive`
    """Reception of a video; like `receive`, after `require_consent`.

    `offset_s` and `consent_at` as in SessionVideo may be set before `keep`; defaults: unknown, and now.
    """

    offset_s: float | None = None
    consent_at: dt.datetime | None = None
    _begins = b""

    def write(self, data: bytes) -> None:
        """Append bytes; raises as `receive.write`."""
        self._begins += data[: max(BEGINS - len(self._begins), 0)]
        super().write(data)

    def keep(self) -> RecordedFile:
        """Store the video; raises ServiceError no_video if browsers cannot play it."""
        if find_media_type(self._begins) is None:
            raise ServiceError(
                "no_video",
                Message(
                    "'{name}' is not a video that browsers can play. Expected MP4, QuickTime or WebM.",
                    name=self._name,
                ),
            )
        return super().keep()

    def _check_set(self, c: Connection, size: int) -> None:
        """No check, as the recording's set is unaffected."""

    def _add(self, c: Connection, blob: Blob) -> RecordedFile:
        key = {"session_id": self._session_id}
        c.execute(delete(session_video).filter_by(**key))
        c.execute(
            insert(session_video).values(
                **key,
                name=self._name,
                media_type=find_media_type(self._begins),
                size=blob.size,
                sha256=blob.sha256,
                offset_s=self.offset_s,
                consent_by=None if self._actor is None else self._actor.name,
                consent_at=self.consent_at or now(),
            )
        )
        detail = {"session_id": self._session_id, "sha256": blob.sha256, "size": blob.size, "consent": True}
        audit.record(c, self._actor, "video.added", "session", self._session_id, detail)
        return RecordedFile(self._name, blob.size, blob.sha256)
