"""Re-authentication by password and code before security keys or tokens are changed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request
from sqlalchemy import Connection

from sagittal.server import audit
from sagittal.server.auth import accounts, second_factor
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.auth.throttle import Throttle
from sagittal.server.context import Config, Db, Failures, OpenTrail, address_of
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.trail import AuditTrail


@dataclass(frozen=True)
class Proof:
    """Verifies the credentials of the signed-in user and counts failures."""

    who: Identity
    address: str
    db: Database
    settings: Settings
    trail: AuditTrail
    failures: Throttle

    def check_password(self, password: str) -> None:
        """Raise Problem 403 for a wrong password, 429 after too many."""
        # 403, not 401: the user is signed in and must not be redirected to the sign-in page
        accounts.check_password(
            self.db, self.failures, self.trail, self.who.name, password, self.address, status=403
        )

    @contextmanager
    def write(self, password: str, code: str) -> Iterator[Connection]:
        """Verify the password, and a code if required, and open a transaction for the change."""
        self.check_password(password)
        with accounts.count_wrong_codes(self.failures, self.who.user_id), self.db.write() as c:
            self._require_code(c, code)
            yield c

    def _require_code(self, c: Connection, code: str) -> None:
        """Verify the second factor after the password. Raises CodeWrong 403."""
        user_id = self.who.user_id
        if not second_factor.is_on(c, user_id):
            return  # the account has no security key either
        remaining = second_factor.count_recovery(c, user_id)
        if not second_factor.use(c, self.settings.second_factor_key, user_id, code):
            raise second_factor.CodeWrong(403)
        left = second_factor.count_recovery(c, user_id)
        if left < remaining:
            audit.record(c, self.who, "user.recovery_code_used", "user", user_id, {"left": left})


async def _proof(
    request: Request,
    db: Db,
    settings: Config,
    trail: OpenTrail,
    failures: Failures,
    user: Annotated[Identity, require(Action.USE_ACCOUNT)],
) -> Proof:
    return Proof(user, address_of(request), db, settings, trail, failures)


Proving = Annotated[Proof, Depends(_proof)]
"""Dependency of routes of the user's own account; also declares the action."""
