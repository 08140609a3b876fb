"""`sagittal user`: add a user or reset a password, from the server's console."""

from __future__ import annotations

import sys
from contextlib import closing
from getpass import getpass
from typing import Literal

from sqlalchemy import select

from sagittal.server.commands.options import DataDir
from sagittal.server.settings import load_settings


def user(
    name: str,
    /,
    *,
    role: Literal["admin", "clinician", "assistant", "viewer"] = "clinician",
    data_dir: DataDir = None,
) -> int:
    """Prompt for a password and store its hash.

    An existing user keeps the role, gets the new password, and loses second factor and tokens.
    """
    from sagittal.server import audit
    from sagittal.server.auth import accounts, api_tokens, second_factor
    from sagittal.server.auth.passwords import hash_password
    from sagittal.server.auth.roles import Role
    from sagittal.server.http.problems import Problem
    from sagittal.server.storage.db import Database
    from sagittal.server.storage.migrate import MigrationError, exists, upgrade
    from sagittal.server.storage.schema.tables import user as table

    settings = load_settings({"data_dir": data_dir})
    password = (
        getpass(f"New password for {name}: ") if sys.stdin.isatty() else sys.stdin.readline().rstrip("\n")
    )
    try:
        hashed = hash_password(password)
        is_new = not exists(settings.database_source)
        upgrade(settings.database_source, backups=settings.backups)
        with closing(Database(settings.database_source)) as db, db.write() as c:
            user_id = c.execute(
                select(table.c.id).where(table.c.name == name.strip().lower())
            ).scalar_one_or_none()
            if user_id is None:
                user_id = accounts.create(c, name.strip().lower(), None, Role(role), hashed).id
                audit.record(c, None, "user.created", "user", user_id, {"role": role, "by": "console"})
            else:
                accounts.change(c, user_id, {"password_hash": hashed})
                second_factor.remove(c, user_id)
                api_tokens.revoke_all(c, user_id)
                audit.record(c, None, "user.password_changed", "user", user_id, {"by": "console"})
    except (Problem, MigrationError) as error:
        sys.stderr.write(f"{error.detail if isinstance(error, Problem) else error}\n")
        return 1
    if is_new:
        sys.stdout.write(f"There was no database in {settings.data_dir}: a new clinic begins there.\n")
    sys.stdout.write(f"{name} can sign in.\n")
    sys.stdout.flush()
    return 0
