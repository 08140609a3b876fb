"""One-time links: `/set-up/{token}` creates the first administrator, `/sign-in/{token}` opens the demo."""

from __future__ import annotations

import datetime as dt
import hashlib
import hmac

from sqlalchemy import Connection, delete, func, insert, select, update

from sagittal.server.auth.tokens import new_token, token_hash
from sagittal.server.http.problems import Problem
from sagittal.server.storage.schema.tables import now, one_time_token, user

LIFE = dt.timedelta(hours=24)


class LinkNotValid(Problem):
    """The link is invalid, for any reason."""

    def __init__(self) -> None:
        super().__init__(
            404,
            "link_not_valid",
            "This address has been used, has expired, or never existed. Restart the server to get a new one.",
        )


def needs_set_up(c: Connection) -> bool:
    """Whether no account exists yet."""
    return not c.execute(select(func.count()).select_from(user)).scalar_one()


def issue_set_up(c: Connection, shared_key: bytes = b"") -> str:
    """Return the token of the set-up link for the first administrator; only the latest is valid.

    Parameters
    ----------
    shared_key : secret of several web servers, all of which return the same token while it is valid. Without
        one, a new token replaces the earlier one.
    """
    if shared_key:
        valid = one_time_token.c.used_at.is_(None) & (one_time_token.c.expires_at > now())
        query = select(one_time_token.c.token_sha256, one_time_token.c.expires_at)
        for row in c.execute(query.where(one_time_token.c.purpose == "set_up", valid)):
            token = _derive(shared_key, row.expires_at)
            if token_hash(token) == row.token_sha256:
                return token
    c.execute(delete(one_time_token).where(one_time_token.c.purpose == "set_up"))
    expires_at = now() + LIFE
    token = _derive(shared_key, expires_at) if shared_key else new_token()
    return _store(c, token, "set_up", None, expires_at)


def issue_sign_in(c: Connection, user_id: str) -> str:
    """Return a token whose link signs this user in once."""
    return _store(c, new_token(), "sign_in", user_id, now() + LIFE)


def is_valid(c: Connection, token: str, purpose: str) -> bool:
    """Whether the link is still valid; does not consume it."""
    return _find(c, token, purpose) is not None


def use(c: Connection, token: str, purpose: str) -> str | None:
    """Consume the token and return its user id (None for set-up); raise LinkNotValid if it is invalid."""
    row = _find(c, token, purpose)
    # the same response for unknown, used and expired links, so that guessing reveals nothing
    if row is None:
        raise LinkNotValid
    hashed = token_hash(token)
    c.execute(update(one_time_token).where(one_time_token.c.token_sha256 == hashed).values(used_at=now()))
    return row[0]


def _store(c: Connection, token: str, purpose: str, user_id: str | None, expires_at: dt.datetime) -> str:
    c.execute(
        insert(one_time_token).values(
            token_sha256=token_hash(token), user_id=user_id, purpose=purpose, expires_at=expires_at
        )
    )
    return token


def _derive(shared_key: bytes, expires_at: dt.datetime) -> str:
    """Return the token that every holder of the key derives for this expiry."""
    return hmac.new(shared_key, f"set-up {expires_at.isoformat()}".encode(), hashlib.sha256).hexdigest()


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
