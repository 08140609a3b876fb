"""A whole web process on an empty data folder, and people of every role to ask it things."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
from fastapi import FastAPI
from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher

from sagittal.server.app import create_app
from sagittal.server.auth import accounts
from sagittal.server.auth.roles import Role
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from tests.helpers.databases import write_database
from tests.helpers.engines import choose_url

PASSWORD = "correct horse battery"
ORIGIN = "http://127.0.0.1"


CHEAP = PasswordHash((Argon2Hasher(time_cost=1, memory_cost=8, parallelism=1),))
"""Without the tenths of a second that a real hash takes."""


@functools.cache
def password_hash() -> str:
    """One password hash for all test accounts, since hashing is slow."""
    return CHEAP.hash(PASSWORD)


@dataclass
class Clinic:
    """A running application."""

    app: FastAPI
    settings: Settings
    users: dict[str, str] = field(default_factory=dict)

    @property
    def db(self) -> Database:
        db: Database = self.app.state.db
        return db

    def user(self, role: str, name: str | None = None) -> str:
        """Id of an account with this role, made at first use; its sign-in name is the role."""
        name = name or role
        if name not in self.users:
            with self.db.write() as c:
                self.users[name] = accounts.create(c, name, None, Role(role), password_hash()).id
        return self.users[name]

    def token(self, role: str, name: str | None = None) -> str:
        """A fresh sign-in of the person with this role."""
        user_id = self.user(role, name)
        with self.db.write() as c:
            token: str = self.app.state.logins.start(c, user_id, None)
        return token

    def client(
        self, role: str | None = None, headers: Mapping[str, str] | None = None, **options: Any
    ) -> httpx.AsyncClient:
        """A client that is signed in with this role, or not at all."""
        cookies = {"sid": self.token(role)} if role else {}
        transport = httpx.ASGITransport(self.app, raise_app_exceptions=options.pop("raises", True))
        return httpx.AsyncClient(
            transport=transport, base_url=ORIGIN, cookies=cookies, headers=headers, **options
        )


@contextlib.asynccontextmanager
async def open_clinic(folder: Path, **settings: Any) -> AsyncIterator[Clinic]:
    """Start and later stop an application on a folder; estimators only with `live_workers`.

    Its database is SQLite, or PostgreSQL with `--engine postgresql`.
    """
    defaults: dict[str, Any] = {"live_workers": 0, "database_url": choose_url(folder)}
    options = Settings(data_dir=folder, **{**defaults, **settings})
    if not options.database_url and not options.database.exists():
        write_database(options.database)
    app = create_app(options)
    async with app.router.lifespan_context(app):
        yield Clinic(app, options)
