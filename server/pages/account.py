"""One's own account."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from server.auth.access import require
from server.auth.identity import Identity
from server.auth.passwords import MIN_LENGTH
from server.auth.roles import Action
from server.context import Db
from server.pages.shell import render_page
from server.pages.words import ROLE_WORDS

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


@router.get("/account")
def show_account(request: Request, db: Db, who: Annotated[Identity, require(Action.USE_ACCOUNT)]) -> Response:
    """One's own password, and signing out."""
    return render_page(
        request, db, who, "account.html", "account",
        user=who, role_text=ROLE_WORDS[who.role], min_password=MIN_LENGTH,
    )  # fmt: skip
