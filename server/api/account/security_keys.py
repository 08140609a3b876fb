"""Security keys of the signed-in user: register, list, remove, and require them for sign-in."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Request

from sagittal.server import audit
from sagittal.server.api import schemas
from sagittal.server.api.account import account_schemas
from sagittal.server.api.account.proofs import Proving
from sagittal.server.api.documents import refusals
from sagittal.server.auth import second_factor, security_keys
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.auth.security_keys import site_of
from sagittal.server.context import Config, Db, Id, OpenTrail
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.http.problems import Problem

router = APIRouter(route_class=StrictJsonRoute, prefix="/account", tags=["account"])
Self = Annotated[Identity, require(Action.USE_ACCOUNT)]


@router.get("/security-keys", response_model=list[account_schemas.SecurityKey])
def list_keys(db: Db, user: Self) -> list[account_schemas.SecurityKey]:
    """List security keys of the signed-in user, oldest first."""
    with db.read() as c:
        rows = security_keys.list_keys(c, user.user_id)
    return [schemas.make_answer(account_schemas.SecurityKey, row) for row in rows]


@router.post(
    "/security-keys/options", response_model=account_schemas.KeyOptions, responses=refusals(409, 429)
)
def begin(
    body: account_schemas.BothProofs, request: Request, settings: Config, proof: Proving
) -> account_schemas.KeyOptions:
    """Options for registering a security key; the browser must respond within five minutes."""
    site, user = site_of(request, behind_tls=settings.behind_tls), proof.who
    with proof.write(body.password, body.code) as c:
        return account_schemas.KeyOptions(security_keys.begin_registration(c, site, user.user_id, user.name))


@router.post(
    "/security-keys",
    status_code=201,
    response_model=account_schemas.SecurityKey,
    responses=refusals(403, 409),
)
def add(
    body: account_schemas.KeyNew, request: Request, db: Db, settings: Config, trail: OpenTrail, user: Self
) -> account_schemas.SecurityKey:
    """Register a security key from its response."""
    site = site_of(request, behind_tls=settings.behind_tls)
    with db.write() as c:  # separate transaction: a rejection must not restore the challenge
        challenge = security_keys.take_challenge(c, user.user_id, "register", body.key)
    try:
        with db.write() as c:
            row = security_keys.register(c, site, user.user_id, body.name, body.key, challenge)
            audit.record(c, user, "user.security_key_added", "user", user.user_id, {"key": row.id})
    except security_keys.KeyRefused:
        trail.record_opened(user, "user.security_key_refused", "user", user.user_id)
        raise
    return schemas.make_answer(account_schemas.SecurityKey, row)


@router.post("/security-keys/{key_id}/remove", status_code=204, responses=refusals(404, 429))
def remove(
    key_id: Id, body: account_schemas.BothProofs, request: Request, settings: Config, proof: Proving
) -> None:
    """Remove a security key; with the last one of this address, authenticator codes are accepted again."""
    site, user = site_of(request, behind_tls=settings.behind_tls), proof.who
    with proof.write(body.password, body.code) as c:
        security_keys.remove(c, site, user.user_id, key_id)
        audit.record(c, user, "user.security_key_removed", "user", user.user_id, {"key": key_id})


@router.put("/second-factor/keys-only", status_code=204, responses=refusals(409, 429))
def choose_keys_only(
    body: account_schemas.KeysOnly, request: Request, settings: Config, proof: Proving
) -> None:
    """Accept security keys and recovery codes only, or authenticator codes as well."""
    site, user = site_of(request, behind_tls=settings.behind_tls), proof.who
    with proof.write(body.password, body.code) as c:
        if body.on and not security_keys.list_usable(c, site, user.user_id):
            raise Problem(409, "no_key", "Set up a security key for this address first.")
        second_factor.take_keys_only(c, user.user_id, body.on)
        audit.record(c, user, "user.keys_only" if body.on else "user.codes_again", "user", user.user_id)
