"""User accounts and roles."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from sagittal.server.auth import accounts, second_factor
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.passwords import MIN_LENGTH
from sagittal.server.auth.roles import Action, Role
from sagittal.server.context import Db
from sagittal.server.pages.shell import render_page
from sagittal.server.pages.words import ROLE_WORDS
from sagittal.server.sharing import care_teams

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


@router.get("/users")
def show_users(request: Request, db: Db, user: Annotated[Identity, require(Action.MANAGE_USERS)]) -> Response:
    """User accounts and roles."""
    with db.read() as c:
        rows = accounts.list_accounts(c)
        care_teams_on = care_teams.are_on(c)
        with_factor = second_factor.list_users(c)
    roles = [(role.value, ROLE_WORDS[role]) for role in Role]
    options = [(role.value, role.value) for role in Role]
    return render_page(
        request, db, user, "users.html", "users",
        users=rows, roles=roles, role_options=options, min_password=MIN_LENGTH,
        with_factor=with_factor, care_teams_on=care_teams_on,
    )  # fmt: skip
