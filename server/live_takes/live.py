"""Live trials: opened for a session, joined by a tablet with a code, ended, and stored as a recording.

    pairing ──code──> open ──first batch──> streaming ──finish──> finished
       └───────────────┴───────── close ────────┴────────────────> closed

The order at the end is what survives a crash: first the take is over (row), then the log is a stored file,
then one transaction makes it a recording with its inspection and analysis, then the log goes. `repair` takes
the steps that a crash left out. Of code and token only hashes are kept.
"""

from __future__ import annotations

import datetime as dt
import hmac
import secrets
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, bindparam, insert, select, update

from sagittal.server import audit
from sagittal.server.auth.tokens import new_token, token_hash
from sagittal.server.clinic import devices, sessions
from sagittal.server.errors import Conflict, NodeAway, NotFound, ServiceError
from sagittal.server.storage.schema.live_tables import OPEN_TAKE_STATES, live_take
from sagittal.server.storage.schema.tables import new_id, now, patient, session

ALPHABET = "23456789ABCDEFGHJKMNPQRSTUVWXYZ"
"""Characters of a code, without those easily confused when read or heard (0 O, 1 I L)."""
CODE_LENGTH = 6
"""31⁶ = 9 · 10⁸ codes, ten failures per address in a quarter of an hour (server/auth/throttle.py)."""
CODE_LIFE = dt.timedelta(minutes=10)
TOKEN_LIFE = dt.timedelta(hours=12)


@dataclass(frozen=True)
class LiveTakeRecord:
    """A live trial of a session.

    Parameters
    ----------
    state : pairing (waiting for a tablet), open (paired), streaming (samples received), finished (by the
        tablet), closed (on the server). source : data source of the tablet, None before its hello.
    count, sha256 : number of batches and the tablet's digest of their payloads, at the end.
    recording_id : the resulting recording; None while running or if nothing was received.
    problem : code of a problem at the end, finish_mismatch or node_away.
    node, node_run : the web server that has its log, and its run; None = a server without a name.
    """

    id: str
    session_id: str
    patient_id: str
    state: str
    source: str | None
    count: int | None
    sha256: str | None
    recording_id: str | None
    prescription_id: str | None
    problem: str | None
    opened_by: str | None
    code_expires_at: dt.datetime | None
    created_at: dt.datetime
    finished_at: dt.datetime | None
    node: str | None
    node_run: int | None

    @property
    def is_open(self) -> bool:
        """Whether more samples may be received."""
        return self.state in OPEN_TAKE_STATES


@dataclass(frozen=True)
class TakeOwner:
    """A web server as the owner of live trials; an unnamed server owns all trials."""

    node: str | None = None
    run: int | None = None

    def has(self, take: LiveTakeRecord) -> bool:
        """Whether a trial belongs to this server or is unassigned."""
        return self.node is None or take.node in (None, self.node)

    def require(self, take: LiveTakeRecord) -> None:
        """Raise NodeAway if another server owns the trial."""
        if not self.has(take):
            raise NodeAway(take.node)


ALONE = TakeOwner()


@dataclass(frozen=True)
class TabletAccess:
    """Credentials that a tablet receives for a code; the token is valid for this trial only."""

    token: str
    take: str
    session_id: str
    session_title: str
    patient_code: str
    remembered: Mapping[str, str]
    """Serial number → last segment."""


def open_take(
    c: Connection, actor: audit.Actor | None, session_id: str, owner: TakeOwner = ALONE
) -> tuple[LiveTakeRecord, str]:
    """Open a trial on this web server; return it with its code; raises NotFound, Conflict take_open."""
    sessions.get(c, session_id)
    earlier = current(c, session_id)
    if earlier is not None and earlier.is_open:
        raise Conflict(
            "take_open", "This visit has an open live recording; request a new code or close it first."
        )
    code, take_id = _new_code(), new_id()
    c.execute(
        insert(live_take).values(
            id=take_id,
            session_id=session_id,
            state="pairing",
            opened_by=actor.user_id if actor else None,
            created_at=now(),
            node=owner.node,
            node_run=owner.run,
            **_code_columns(code),
        )
    )
    audit.record(c, actor, "live.opened", "session", session_id, {"take_id": take_id})
    return get(c, take_id), code


def new_code(c: Connection, actor: audit.Actor | None, session_id: str) -> tuple[LiveTakeRecord, str]:
    """Issue another code; a joined tablet remains connected until it is used."""
    this = require_open(c, session_id)
    code = _new_code()
    c.execute(update(live_take).where(live_take.c.id == this.id).values(**_code_columns(code)))
    audit.record(c, actor, "live.code_given", "session", session_id, {"take_id": this.id})
    return get(c, this.id), code


class CodeNotValid(ServiceError):  # noqa: N818 - what the person reads
    """The pairing code is unknown, used or expired, without distinction."""

    status = 404

    def __init__(self) -> None:
        super().__init__(
            "code_not_valid",
            "This code has been used, has expired, or was mistyped. Request a new one on the live page.",
        )


def pair(c: Connection, code: str) -> TabletAccess:
    """Consume a code; raises CodeNotValid. The caller counts failures (server/auth/throttle.py)."""
    plain = "".join(code.split()).replace("-", "").upper()
    token, issued_at = new_token(), now()
    row = c.execute(
        select(live_take.c.id, live_take.c.session_id, live_take.c.state, session.c.title, patient.c.code)
        .join(session, session.c.id == live_take.c.session_id)
        .join(patient, patient.c.id == session.c.patient_id)
        .where(
            live_take.c.code_sha256 == token_hash(plain),
            live_take.c.code_expires_at > issued_at,
            live_take.c.state.in_(OPEN_TAKE_STATES),
        )
    ).first()
    if row is None:
        raise CodeNotValid
    values = {
        "state": "open" if row.state == "pairing" else row.state,
        "code_sha256": None,
        "code_expires_at": None,
        "token_sha256": token_hash(token),
        "token_expires_at": issued_at + TOKEN_LIFE,
    }
    c.execute(update(live_take).where(live_take.c.id == row.id).values(values))
    audit.record(c, None, "live.paired", "session", row.session_id, {"take_id": row.id})
    places = devices.recall_places(c).segments
    return TabletAccess(token, row.id, row.session_id, row.title, row.code, places)


def by_token(c: Connection, take_id: str, token: str) -> LiveTakeRecord | None:
    """The trial of this token, ended or not; None if the token is unknown or expired."""
    row = c.execute(
        select(live_take.c.token_sha256, live_take.c.token_expires_at).where(live_take.c.id == take_id)
    ).first()
    if row is None or row.token_sha256 is None or row.token_expires_at <= now():
        return None
    return get(c, take_id) if hmac.compare_digest(row.token_sha256, token_hash(token)) else None


def note_start(c: Connection, take_id: str, source: str) -> LiveTakeRecord:
    """Record the first samples."""
    c.execute(
        update(live_take)
        .where(live_take.c.id == take_id, live_take.c.state.in_(("pairing", "open")))
        .values(state="streaming", source=source)
    )
    return get(c, take_id)


def end(
    c: Connection,
    actor: audit.Actor | None,
    take_id: str,
    state: str,
    *,
    count: int,
    sha256: str | None = None,
    problem: str | None = None,
) -> LiveTakeRecord:
    """End a trial as finished or closed; no effect if it has ended."""
    changed = c.execute(
        update(live_take)
        .where(live_take.c.id == take_id, live_take.c.state.in_(OPEN_TAKE_STATES))
        .values(
            state=state,
            finished_at=now(),
            count=count,
            sha256=sha256,
            problem=problem,
            code_sha256=None,
            code_expires_at=None,
        )
    ).rowcount
    this = get(c, take_id)
    if changed:
        detail = {"take_id": take_id, "count": count, "problem": problem}
        audit.record(c, actor, f"live.{state}", "session", this.session_id, detail)
    return this


def get(c: Connection, take_id: str) -> LiveTakeRecord:
    """One take; raises NotFound."""
    row = c.execute(_QUERY.where(live_take.c.id == take_id)).first()
    if row is None:
        raise NotFound("live recording", take_id)
    return LiveTakeRecord(**row._asdict())


def find_many(c: Connection, take_ids: Collection[str]) -> dict[str, LiveTakeRecord]:
    """Those of these trials that exist, by id."""
    rows = c.execute(_QUERY.where(live_take.c.id.in_(take_ids)))
    return {row.id: LiveTakeRecord(**row._asdict()) for row in rows}


def current(c: Connection, session_id: str) -> LiveTakeRecord | None:
    """The session's latest trial, None before the first."""
    row = c.execute(_NEWEST, {"of_session": session_id}).first()
    return None if row is None else LiveTakeRecord(**row._asdict())


def require_open(c: Connection, session_id: str) -> LiveTakeRecord:
    """The session's open trial; raises NotFound, Conflict no_open_take."""
    sessions.get(c, session_id)
    this = current(c, session_id)
    if this is None or not this.is_open:
        raise Conflict("no_open_take", "This visit has no open live recording; start one first.")
    return this


def list_running(c: Connection) -> list[LiveTakeRecord]:
    """All trials that receive samples or may do so at any moment, the former last.

    Excludes those whose code expired before a tablet joined.
    """
    waiting = (live_take.c.state == "pairing") & (live_take.c.code_expires_at > now())
    query = _QUERY.where(live_take.c.state.in_(("open", "streaming")) | waiting)
    rows = c.execute(query.order_by(live_take.c.state == "streaming", live_take.c.created_at))
    return [LiveTakeRecord(**row._asdict()) for row in rows]


def takes_of(c: Connection, session_id: str) -> list[LiveTakeRecord]:
    """All trials of a session, oldest first."""
    query = _QUERY.where(live_take.c.session_id == session_id)
    return [LiveTakeRecord(**row._asdict()) for row in c.execute(query.order_by(live_take.c.created_at))]


_COLUMNS = tuple(live_take.c[name] for name in LiveTakeRecord.__dataclass_fields__ if name in live_take.c)
_QUERY = select(*_COLUMNS, session.c.patient_id).join(session, session.c.id == live_take.c.session_id)
_NEWEST = (
    _QUERY.where(live_take.c.session_id == bindparam("of_session"))
    .order_by(live_take.c.created_at.desc(), live_take.c.id)
    .limit(1)
)


def _new_code() -> str:
    return "".join(secrets.choice(ALPHABET) for _ in range(CODE_LENGTH))


def _code_columns(code: str) -> dict[str, Any]:
    return {"code_sha256": token_hash(code), "code_expires_at": now() + CODE_LIFE}
