"""Account page of the signed-in user."""

from __future__ import annotations

from typing import Annotated, Final

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from sagittal.server.auth import api_tokens, second_factor, security_keys
from sagittal.server.auth.access import require
from sagittal.server.auth.api_tokens import Scope
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.passwords import MIN_LENGTH
from sagittal.server.auth.roles import Action
from sagittal.server.auth.security_keys import site_of
from sagittal.server.context import Config, Db
from sagittal.server.pages.shell import render_page
from sagittal.server.pages.words import ROLE_WORDS
from sagittal.server.storage.schema.tables import now

SCOPE_WORDS: Final = {
    Scope.READ: "Read patients, visits and results",
    Scope.UPLOAD: "Add visits and upload recordings",
    Scope.WRITE: "Add and change patients and visits, analyse, review",
    Scope.METRICS: "Read the metrics of the server",
}

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


@router.get("/account")
def show_account(
    request: Request, db: Db, settings: Config, user: Annotated[Identity, require(Action.USE_ACCOUNT)]
) -> Response:
    """Password, second factor, security keys, tokens and sign-out of the signed-in user."""
    with db.read() as c:
        tokens = api_tokens.list_tokens(c, user.user_id)
        has_factor, codes = (
            second_factor.is_on(c, user.user_id),
            second_factor.count_recovery(c, user.user_id),
        )
        keys, keys_only = (
            security_keys.list_keys(c, user.user_id),
            second_factor.takes_keys_only(c, user.user_id),
        )
    keys_work = site_of(request, behind_tls=settings.behind_tls).has_keys
    return render_page(
        request, db, user, "account.html", "account",
        user=user, role_text=ROLE_WORDS[user.role], min_password=MIN_LENGTH, tokens=tokens, at=now(),
        scopes=[(scope.value, word) for scope, word in SCOPE_WORDS.items()],
        keys=keys, keys_only=keys_only, keys_work=keys_work,
        has_factor=has_factor, codes=codes, most_days=api_tokens.MOST_DAYS,
    )  # fmt: skip
