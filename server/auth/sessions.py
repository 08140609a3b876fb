"""Sign-ins kept on the server: they end when idle, after twelve hours, at sign-out, or when revoked."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from typing import Any

from sqlalchemy import Connection, Row, delete, insert, select, update

from server.auth.identity import Identity
from server.auth.roles import Role
from server.auth.tokens import new_token, token_hash
from server.storage.db import Database
from server.storage.tables import login_session, now, user

TOUCH_EVERY = dt.timedelta(seconds=30)
"""Activity is written at most this often: each write costs one fsync."""


class Logins:
    """The open sign-ins.

    Parameters
    ----------
    db : the database.
    idle, absolute : life without activity, and life in all (service.md §d).
    clock : aware time now.
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

    def start(self, c: Connection, user_id: str, replaces: str | None) -> str:
        """Open a sign-in and return its new token; the token the browser came with, if any, ends here."""
        at = self._clock()
        if replaces is not None:
            self.end(c, token_hash(replaces))
        c.execute(delete(login_session).where(login_session.c.expires_at <= at))
        token = new_token()
        c.execute(
            insert(login_session).values(
                token_sha256=token_hash(token),
                user_id=user_id,
                created_at=at,
                last_seen_at=at,
                expires_at=at + self._absolute,
            )
        )
        return token

    def find(self, token: str) -> Identity | None:
        """Return who holds this token and count the visit as activity; None when it is unknown or over."""
        return self.touch(token_hash(token))

    def touch(self, login_id: str) -> Identity | None:
        """Count a running view or replay as activity; None when the sign-in is over, so the view must end."""
        at = self._clock()
        row = self._open(login_id, at)
        if row is None:
            return None
        # a short idle time must not end between two writes
        if row.last_seen_at <= at - min(TOUCH_EVERY, self._idle / 4):
            with self._db.write() as c:
                c.execute(
                    update(login_session)
                    .where(login_session.c.token_sha256 == login_id)
                    .values(last_seen_at=at)
                )
        return Identity(row.id, row.name, row.display_name, Role(row.role), login_id)

    def is_open(self, login_id: str) -> bool:
        """Tell whether a sign-in goes on, without counting as activity."""
        return self._open(login_id, self._clock()) is not None

    def end(self, c: Connection, login_id: str) -> None:
        """End one sign-in."""
        c.execute(delete(login_session).where(login_session.c.token_sha256 == login_id))

    def end_all(self, c: Connection, user_id: str, but: str | None = None) -> None:
        """End every sign-in of one person, except the one (by its login id) that asks for it."""
        c.execute(
            delete(login_session).where(
                login_session.c.user_id == user_id, login_session.c.token_sha256 != (but or "")
            )
        )

    def _open(self, login_id: str, at: dt.datetime) -> Row[Any] | None:
        with self._db.read() as c:
            return c.execute(
                select(login_session.c.last_seen_at, user)
                .join(user, user.c.id == login_session.c.user_id)
                .where(
                    login_session.c.token_sha256 == login_id,
                    login_session.c.expires_at > at,
                    login_session.c.last_seen_at > at - self._idle,
                    user.c.active,
                )
            ).one_or_none()
