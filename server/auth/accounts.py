"""User accounts of the clinic and their roles."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from enum import StrEnum
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Row, func, insert, select, update
from sqlalchemy.exc import IntegrityError

from sagittal.server.auth import second_factor, security_keys
from sagittal.server.auth.passwords import verify_password
from sagittal.server.auth.roles import Role
from sagittal.server.auth.security_keys import Site
from sagittal.server.auth.throttle import Throttle
from sagittal.server.http.problems import Problem
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.tables import new_id, now, user
from sagittal.server.trail import AuditTrail


def create(c: Connection, name: str, display_name: str | None, role: Role, password_hash: str) -> Row[Any]:
    """Add an account and return its row; raise Problem 409 if the name is taken."""
    values = {
        "id": new_id(),
        "name": name,
        "display_name": display_name or name,
        "role": role.value,
        "password_hash": password_hash,
        "active": True,
        "created_at": now(),
    }
    try:
        c.execute(insert(user).values(values))
    except IntegrityError as error:
        raise Problem(409, "name_taken", "An account with this name exists. Choose another name.") from error
    return get(c, str(values["id"]))


def get(c: Connection, user_id: str) -> Row[Any]:
    """Return one account; raise Problem 404 if it does not exist."""
    row = c.execute(select(user).where(user.c.id == user_id)).one_or_none()
    if row is None:
        raise Problem(404, "user_not_found", "No such account.")
    return row


def list_accounts(c: Connection) -> list[Row[Any]]:
    """Return all accounts, ordered by name."""
    return list(c.execute(select(user).order_by(user.c.name)).all())


def change(c: Connection, user_id: str, values: dict[str, object]) -> Row[Any]:
    """Update an account and return it; raise Problem 409 if no active administrator would remain."""
    get(c, user_id)
    if values:
        c.execute(update(user).where(user.c.id == user_id).values(values))
    admins = select(func.count()).select_from(user).where(user.c.role == Role.ADMIN.value, user.c.active)
    if not c.execute(admins).scalar_one():
        raise Problem(
            409,
            "last_administrator",
            "This is the last active administrator. Make another user an administrator first.",
        )
    return get(c, user_id)


def check_password(
    db: Database,
    throttle: Throttle,
    trail: AuditTrail,
    name: str,
    password: str,
    address: str,
    *,
    status: int = 401,
) -> Row[Any]:
    """Return the account for a user name and password; failures are recorded in the audit log.

    Raises
    ------
    Problem
        429 after too many failures, otherwise `status`, with the same message for an unknown name, a wrong
        password and a closed account.
    """
    name = name.strip().lower()
    begun = throttle.begin(name, address)
    try:
        with db.read() as c:
            row = c.execute(select(user).where(user.c.name == name)).one_or_none()
        stored = row.password_hash if row is not None and row.active else None
        is_right = verify_password(password, stored)
    except BaseException:
        throttle.withdraw(name, address, begun)
        raise
    if not is_right or row is None:
        trail.record_refused("sign_in.failed", "user", None if row is None else row.id, address)
        raise Problem(status, "wrong_password", "Incorrect name or password. Check both and try again.")
    throttle.withdraw(name, address, begun)
    throttle.succeed(name, address)
    return row


class Factor(StrEnum):
    """Authentication factor used in addition to the password, if any."""

    PASSWORD = "password"  # noqa: S105 - the name of a factor
    CODE = "code"
    RECOVERY_CODE = "recovery_code"
    SECURITY_KEY = "security_key"


def check_code(
    db: Database,
    key_file: Path,
    throttle: Throttle,
    trail: AuditTrail,
    user_id: str,
    code: str | None,
    key: tuple[Site, Mapping[str, Any]] | None,
    address: str,
) -> Factor:
    """Verify the second factor after the password, if the account has one: a code or a security key.

    Returns
    -------
    The factor that was used.

    Raises
    ------
    CodeNeeded, CodeWrong
        401 if the code is missing or wrong. Problem 429 after too many failures.
    """
    with db.read() as c:
        if not second_factor.is_on(c, user_id):
            return Factor.PASSWORD
    if key is not None:
        with count_wrong_codes(throttle, user_id):
            with db.write() as c:
                is_right = security_keys.use(c, key[0], user_id, key[1])
            if not is_right:
                trail.record_refused("sign_in.failed", "user", user_id, address)
                raise security_keys.KeyRefused(401)
        return Factor.SECURITY_KEY
    if not (code or "").strip():
        raise second_factor.CodeNeeded
    with count_wrong_codes(throttle, user_id):
        with db.write() as c:
            remaining_before = second_factor.count_recovery(c, user_id)
            is_right = second_factor.use(c, key_file, user_id, code or "")
            remaining_after = second_factor.count_recovery(c, user_id)
        if not is_right:
            trail.record_refused("sign_in.failed", "user", user_id, address)
            raise second_factor.CodeWrong(401)
    return Factor.RECOVERY_CODE if remaining_after < remaining_before else Factor.CODE


@contextlib.contextmanager
def count_wrong_codes(throttle: Throttle, user_id: str) -> Iterator[None]:
    """Count a failed code of an account from any address; ten are allowed per quarter of an hour."""
    key = f"code of {user_id}"
    begun = throttle.begin(key, key)
    try:
        yield
    except (second_factor.CodeWrong, security_keys.KeyRefused):
        raise
    except BaseException:
        throttle.withdraw(key, key, begun)
        raise
    throttle.withdraw(key, key, begun)
