"""One-time addresses: `/set-up/{token}` makes the first administrator, `/sign-in/{token}` opens the demo."""

from __future__ import annotations

import datetime as dt

from sqlalchemy import Connection, delete, func, insert, select, update

from server.auth.tokens import new_token, token_hash
from server.http.problems import Problem
from server.storage.tables import now, one_time_token, user

LIFE = dt.timedelta(hours=24)


class LinkNotValid(Problem):
    """The address cannot be used, for whatever reason."""

    def __init__(self) -> None:
        super().__init__(
            404,
            "link_not_valid",
            "This address has been used, has expired, or never existed. Restart the server to get a new one.",
        )


def needs_set_up(c: Connection) -> bool:
    """Tell whether nobody can sign in yet."""
    return not c.execute(select(func.count()).select_from(user)).scalar_one()


def issue_set_up(c: Connection) -> str:
    """Return the token of the first administrator's set-up address; an earlier one ends."""
    c.execute(delete(one_time_token).where(one_time_token.c.purpose == "set_up"))
    return _issue(c, "set_up", None)


def issue_sign_in(c: Connection, user_id: str) -> str:
    """Return a token whose address signs this person in once."""
    return _issue(c, "sign_in", user_id)


def is_valid(c: Connection, token: str, purpose: str) -> bool:
    """Tell whether the address may still be used, without using it."""
    return _find(c, token, purpose) is not None


def use(c: Connection, token: str, purpose: str) -> str | None:
    """Use the token up and return its user id (None for set-up); raise NotValid when it cannot be used."""
    row = _find(c, token, purpose)
    # one answer for unknown, used and expired: nothing to learn by guessing
    if row is None:
        raise LinkNotValid
    hashed = token_hash(token)
    c.execute(update(one_time_token).where(one_time_token.c.token_sha256 == hashed).values(used_at=now()))
    return row[0]


def _issue(c: Connection, purpose: str, user_id: str | None) -> str:
    token = new_token()
    c.execute(
        insert(one_time_token).values(
            token_sha256=token_hash(token), user_id=user_id, purpose=purpose, expires_at=now() + LIFE
        )
    )
    return token


def _find(c: Connection, token: str, purpose: str) -> tuple[str | None] | None:
    if purpose == "set_up" and not needs_set_up(c):
        return None
    row = c.execute(
        select(one_time_token.c.user_id).where(
            one_time_token.c.token_sha256 == token_hash(token),
            one_time_token.c.purpose == purpose,
            one_time_token.c.used_at.is_(None),
            one_time_token.c.expires_at > now(),
        )
    ).one_or_none()
    return None if row is None else (row.user_id,)
