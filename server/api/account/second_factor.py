"""Second factor of the signed-in user: set up, confirm, remove."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter

from sagittal.server import audit
from sagittal.server.api.account import account_schemas
from sagittal.server.api.account.proofs import Proving
from sagittal.server.api.documents import refusals
from sagittal.server.auth import accounts, second_factor
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Config, Db, Failures
from sagittal.server.http.json_body import StrictJsonRoute

router = APIRouter(route_class=StrictJsonRoute, prefix="/account/second-factor", tags=["account"])
Self = Annotated[Identity, require(Action.USE_ACCOUNT)]


@router.post("", response_model=second_factor.SecondFactorSetUp, responses=refusals(409, 429))
def set_up(
    body: account_schemas.PasswordProof, db: Db, settings: Config, proof: Proving
) -> second_factor.SecondFactorSetUp:
    """Create a secret for an authenticator; it takes effect once confirmed by a code (`confirm`)."""
    proof.check_password(body.password)
    with db.write() as c:
        return second_factor.begin(c, settings.second_factor_key, proof.who.user_id, proof.who.name)


@router.post("/confirm", response_model=account_schemas.RecoveryCodes, responses=refusals(429))
def confirm(
    body: account_schemas.CodeProof, db: Db, settings: Config, failures: Failures, user: Self
) -> account_schemas.RecoveryCodes:
    """Activate the second factor; the response contains the recovery codes, shown only once."""
    with accounts.count_wrong_codes(failures, user.user_id), db.write() as c:
        codes = second_factor.confirm(c, settings.second_factor_key, user.user_id, body.code)
        audit.record(c, user, "user.second_factor_on", "user", user.user_id)
    return account_schemas.RecoveryCodes("\n".join(codes))


@router.post("/remove", status_code=204, responses=refusals(429))
def remove(body: account_schemas.CodeProof, db: Db, settings: Config, failures: Failures, user: Self) -> None:
    """Deactivate the second factor; requires a code or a recovery code."""
    with accounts.count_wrong_codes(failures, user.user_id), db.write() as c:
        if not second_factor.use(c, settings.second_factor_key, user.user_id, body.code):
            raise second_factor.CodeWrong(403)
        second_factor.remove(c, user.user_id)
        audit.record(c, user, "user.second_factor_off", "user", user.user_id)
