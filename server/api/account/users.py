"""User accounts, for administrators."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter
from sqlalchemy import Row

from sagittal.server import audit
from sagittal.server.api import schemas
from sagittal.server.api.account import account_schemas
from sagittal.server.api.documents import refusals
from sagittal.server.auth import accounts, api_tokens, second_factor
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.passwords import hash_password
from sagittal.server.auth.roles import Action, Role
from sagittal.server.context import Db, Failures, Id, OpenLogins
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.http.problems import Problem
from sagittal.server.sharing import report_links

router = APIRouter(route_class=StrictJsonRoute, prefix="/users", tags=["users"])
Admin = Annotated[Identity, require(Action.MANAGE_USERS)]


@router.get("", response_model=list[account_schemas.User])
def list_users(db: Db, user: Admin) -> list[account_schemas.User]:
    """List all accounts by name."""
    with db.read() as c:
        return [user_answer(row) for row in accounts.list_accounts(c)]


@router.post("", status_code=201, response_model=account_schemas.User, responses=refusals(409))
def add_user(body: account_schemas.UserNew, db: Db, user: Admin) -> account_schemas.User:
    """Add an account with an initial password."""
    hashed = hash_password(body.password)
    with db.write() as c:
        row = accounts.create(c, body.name, body.display_name, body.role, hashed)
        audit.record(c, user, "user.created", "user", row.id, {"role": row.role})
    return user_answer(row)


@router.patch("/{user_id}", response_model=account_schemas.User, responses=refusals(409))
def change_user(
    user_id: Id, body: account_schemas.UserChange, db: Db, logins: OpenLogins, failures: Failures, user: Admin
) -> account_schemas.User:
    """Change role, display name or password, or close the account.

    Ends the user's sign-ins; a new password also revokes API tokens. Report links end if their creator's
    account is closed or may no longer open the patient.
    """
    values = body.model_dump(exclude_unset=True, mode="json")
    fields = sorted(values)
    if "password" in values:
        values["password_hash"] = hash_password(values.pop("password"))
    with db.write() as c:
        previous = accounts.get(c, user_id)
        row = accounts.change(c, user_id, values)
        if "password_hash" in values or (row.role, row.active) != (previous.role, previous.active):
            logins.end_all(c, user_id, but=user.login_id)
        if "password_hash" in values:
            api_tokens.revoke_all(c, user_id)
        audit.record(c, user, "user.changed", "user", user_id, {"fields": fields, "role": row.role})
        report_links.end_orphaned(c, user)
    if "password_hash" in values:
        failures.forgive(row.name)
    return user_answer(row)


@router.delete("/{user_id}/second-factor", status_code=204, responses=refusals(404))
def reset_second_factor(user_id: Id, db: Db, logins: OpenLogins, user: Admin) -> None:
    """Remove a user's second factor, for example after losing the phone; the user's sign-ins end."""
    with db.write() as c:
        accounts.get(c, user_id)
        if not second_factor.remove(c, user_id):
            raise Problem(404, "second_factor_off", "This account has no second factor.")
        logins.end_all(c, user_id, but=user.login_id)
        audit.record(c, user, "user.second_factor_reset", "user", user_id)


def user_answer(row: Row[Any]) -> account_schemas.User:
    """Convert a row to a response without the password."""
    return schemas.make_answer(account_schemas.User, row, role=Role(row.role))
