"""Sign-in sessions on the server: they end when idle, after twelve hours, at sign-out, or when revoked."""

from __future__ import annotations

import dataclasses
import datetime as dt
from collections.abc import Callable, Mapping
from typing import Final

from sqlalchemy import Connection, delete, insert, select, update
from sqlalchemy.exc import OperationalError

from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Role
from sagittal.server.auth.sight import NOTHING, opens_parts
from sagittal.server.auth.tokens import new_token, token_hash
from sagittal.server.storage.db import Database
from sagittal.server.storage.refusal import is_busy, refusal_of
from sagittal.server.storage.schema.tables import login_session, now, user

TOUCH_EVERY = dt.timedelta(seconds=30)
"""Minimum interval of writing activity: each write costs one fsync."""
CHECK_EVERY_S: Final = 10.0
"""Interval at which an open websocket or event stream checks its sign-in."""
MOST_KEPT: Final = 1000
"""Sign-ins held in memory because the disk was not writable."""


@dataclasses.dataclass(frozen=True)
class _Login:
    """One sign-in as stored in the database, or in memory while the disk is not writable."""

    user_id: str
    last_seen_at: dt.datetime
    expires_at: dt.datetime


class Logins:
    """Open sign-ins.

    While the disk is not writable, users can still sign in, work and sign out: sessions are then held in
    memory and end with the process.

    Parameters
    ----------
    db : the database.
    idle, absolute : lifetime without activity, and in total (docs/how-to/operations.md, "Settings").
    clock : returns the current time, aware.
    """

    def __init__(
        self,
        db: Database,
        idle: dt.timedelta,
        absolute: dt.timedelta,
        clock: Callable[[], dt.datetime] = now,
    ) -> None:
        self._db = db
        self._idle = idle
        self._absolute = absolute
        self._clock = clock
        self._kept: dict[str, _Login] = {}  # opened while the disk was not writable
        self._seen: dict[
            str, dt.datetime
        ] = {}  # activity not written because of a disk error or a concurrent write
        self._ended: set[str] = set()  # sign-outs not written because of a disk error

    def start(self, c: Connection, user_id: str, replaces: str | None) -> str:
        """Open a sign-in and return its new token; the browser's previous token, if any, is revoked."""
        time = self._clock()
        if replaces is not None:
            self.end(c, token_hash(replaces))
        gone = login_session.c.token_sha256.in_(self._ended)
        c.execute(delete(login_session).where((login_session.c.expires_at <= time) | gone))
        token = new_token()
        c.execute(
            insert(login_session).values(
                token_sha256=token_hash(token),
                user_id=user_id,
                created_at=time,
                last_seen_at=time,
                expires_at=time + self._absolute,
            )
        )
        return token

    def keep(self, user_id: str, replaces: str | None) -> str | None:
        """Open a sign-in in memory while the disk is not writable; None if there are too many."""
        time = self._clock()
        if replaces is not None:
            self._forget(token_hash(replaces))
        self._kept = {k: v for k, v in self._kept.items() if v.expires_at > time}
        if len(self._kept) >= MOST_KEPT:
            return None
        token = new_token()
        self._kept[token_hash(token)] = _Login(user_id, time, time + self._absolute)
        return token

    def find(self, token: str, parts: Mapping[str, str] = NOTHING) -> Identity | None:
        """Return the identity for a token and count the request as activity; None if unknown or expired.

        Parameters
        ----------
        parts : path parameters, for which access is determined as well.
        """
        return self.touch(token_hash(token), parts)

    def look(self, token: str, parts: Mapping[str, str] = NOTHING) -> Identity | None:
        """Return the identity for a token without counting the request as activity."""
        session = self._open(token_hash(token), self._clock(), parts)
        return None if session is None else session[1]

    def seconds_left(self, login_id: str) -> float:
        """Seconds until a sign-in expires without activity; 0 if it has expired. Does not count as
        activity.
        """
        time = self._clock()
        session = self._open(login_id, time)
        if session is None:
            return 0.0
        login, _ = session
        return (min(login.expires_at, login.last_seen_at + self._idle) - time).total_seconds()

    def touch(self, login_id: str, parts: Mapping[str, str] = NOTHING) -> Identity | None:
        """Count a running view or replay as activity; None if the sign-in has ended and the view must
        close.
        """
        time = self._clock()
        session = self._open(login_id, time, parts)
        if session is None:
            return None
        login, identity = session
        # a short idle time must not expire between two writes
        if login.last_seen_at <= time - min(TOUCH_EVERY, self._idle / 4):
            self._write_seen(login_id, time)
        return identity

    def close(self, login_id: str) -> None:
        """End one sign-in, also while the disk is not writable."""
        try:
            with self._db.write() as c:
                self.end(c, login_id)
        except OperationalError as error:
            if refusal_of(error) is None:
                raise
            self._forget(login_id)

    def end(self, c: Connection, login_id: str) -> None:
        """End one sign-in."""
        self._kept.pop(login_id, None)
        c.execute(delete(login_session).where(login_session.c.token_sha256 == login_id))

    def end_all(self, c: Connection, user_id: str, but: str | None = None) -> None:
        """End every sign-in of one user, except the one with the given login id."""
        for login_id in [k for k, v in self._kept.items() if v.user_id == user_id and k != but]:
            self._kept.pop(login_id, None)
        c.execute(
            delete(login_session).where(
                login_session.c.user_id == user_id, login_session.c.token_sha256 != (but or "")
            )
        )

    def _open(
        self, login_id: str, time: dt.datetime, parts: Mapping[str, str] = NOTHING
    ) -> tuple[_Login, Identity] | None:
        """The sign-in and its identity, None if it is unknown or expired."""
        if login_id in self._ended:
            return None
        held = self._kept.get(login_id)
        opens = opens_parts(parts).label("opens")
        stored = select(login_session.c.last_seen_at, login_session.c.expires_at, user, opens).join(
            user, user.c.id == login_session.c.user_id
        )
        query = (
            stored.where(login_session.c.token_sha256 == login_id)
            if held is None
            else select(user, opens).where(user.c.id == held.user_id)
        )
        rows = self._db.ask(query.where(user.c.active))
        if not rows:
            return None
        [person] = rows
        login = held or _Login(person.id, person.last_seen_at, person.expires_at)
        last_seen = max(login.last_seen_at, self._seen.get(login_id, login.last_seen_at))
        if login.expires_at <= time or last_seen <= time - self._idle:
            return None
        identity = Identity(
            person.id,
            person.name,
            person.display_name,
            Role(person.role),
            login_id,
            person.language,
            opens=bool(person.opens),
        )
        return dataclasses.replace(login, last_seen_at=last_seen), identity

    def _write_seen(self, login_id: str, time: dt.datetime) -> None:
        if login_id not in self._kept:
            try:
                with self._db.write() as c:
                    c.execute(
                        update(login_session)
                        .where(login_session.c.token_sha256 == login_id)
                        .values(last_seen_at=time)
                    )
            except OperationalError as error:
                # busy or not writable: a read-only page need not wait for a retry
                if refusal_of(error) is None and not is_busy(error):
                    raise
            else:
                self._seen.pop(login_id, None)
                return
        self._seen[login_id] = time

    def _forget(self, login_id: str) -> None:
        """End a sign-in in memory; a stored one expires when idle."""
        if self._kept.pop(login_id, None) is None:
            self._ended.add(login_id)
