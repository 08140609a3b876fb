"""API tokens of the signed-in user."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter

from sagittal.server import audit
from sagittal.server.api.account.account_schemas import ApiToken, ApiTokenNew, NewApiToken
from sagittal.server.api.account.proofs import Proving
from sagittal.server.api.documents import refusals
from sagittal.server.api.schemas import make_answer
from sagittal.server.auth import api_tokens
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Db, Id
from sagittal.server.http.json_body import StrictJsonRoute

router = APIRouter(route_class=StrictJsonRoute, prefix="/account/tokens", tags=["account"])
Self = Annotated[Identity, require(Action.USE_ACCOUNT)]


@router.get("", response_model=list[ApiToken])
def list_tokens(db: Db, user: Self) -> list[ApiToken]:
    """List API tokens of the signed-in user, newest first, without their secrets."""
    with db.read() as c:
        return [make_answer(ApiToken, row) for row in api_tokens.list_tokens(c, user.user_id)]


@router.post("", status_code=201, response_model=NewApiToken, responses=refusals(409, 429))
def make_token(body: ApiTokenNew, db: Db, proof: Proving) -> NewApiToken:
    """Create an API token; requires the password. The token is shown only in this response."""
    proof.check_password(body.password)
    user = proof.who
    with db.write() as c:
        row, token = api_tokens.issue(c, user.user_id, body.name, set(body.scopes), body.days)
        detail = {"scopes": row.scopes, "days": body.days}
        audit.record(c, user, "token.made", "api_token", row.id, detail)
    return make_answer(NewApiToken, row, token=token)


@router.delete("/{token_id}", status_code=204, responses=refusals(404))
def revoke_token(token_id: Id, db: Db, user: Self) -> None:
    """Revoke a token immediately."""
    with db.write() as c:
        api_tokens.revoke(c, user.user_id, token_id)
        audit.record(c, user, "token.revoked", "api_token", token_id)
