"""Sign-in and sign-out, set-up of the first administrator, and the user's own account."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import TypeAdapter, ValidationError
from sqlalchemy import Connection, Row
from sqlalchemy.exc import OperationalError
from starlette.requests import ClientDisconnect
from starlette.responses import JSONResponse, RedirectResponse

from sagittal.server import audit
from sagittal.server.api.account import account_schemas
from sagittal.server.api.account.proofs import Proving
from sagittal.server.api.account.users import user_answer
from sagittal.server.api.documents import PUBLIC, refusals
from sagittal.server.auth import accounts, one_time, second_factor
from sagittal.server.auth.access import require
from sagittal.server.auth.cookie import clear_token, read_token, set_token
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.passwords import hash_password
from sagittal.server.auth.roles import POLICY, Action, Role
from sagittal.server.auth.security_keys import begin_sign_in, site_of
from sagittal.server.auth.sessions import Logins
from sagittal.server.auth.tokens import token_hash
from sagittal.server.context import Config, Db, Failures, OpenLogins, OpenTrail, address_of
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.http.local_path import local_path
from sagittal.server.http.problems import SENTENCES, Problem
from sagittal.server.storage.refusal import refusal_of
from sagittal.server.trail import AuditTrail

router = APIRouter(route_class=StrictJsonRoute, tags=["account"])
address_router = APIRouter(include_in_schema=False)

_USER = TypeAdapter(account_schemas.User)
_FORM = "application/x-www-form-urlencoded"
_BODY = {"schema": account_schemas.SignIn.model_json_schema()}
_FORM_BODY = {"schema": account_schemas.SignInForm.model_json_schema()}


async def _credentials(request: Request) -> account_schemas.SignIn:
    """Read JSON, or the form of a page without scripts."""
    is_form = request.headers.get("content-type", "").startswith(_FORM)
    try:
        await request.body()
    except ClientDisconnect:
        raise Problem(400, "bad_request", SENTENCES["bad_request"]) from None
    try:
        if is_form:
            form = account_schemas.SignInForm.model_validate(dict(await request.form()))
            return account_schemas.SignIn(**form.model_dump())
        return account_schemas.SignIn.model_validate(await request.json())
    except json.JSONDecodeError as error:
        detail = {"type": "json_invalid", "loc": ("body", error.pos), "msg": error.msg}
        raise RequestValidationError([detail]) from None
    except ValidationError as error:
        items = [{**item, "loc": ("body", *item["loc"])} for item in error.errors()]
        raise RequestValidationError(items) from error


@router.post(
    "/sign-in",
    dependencies=[require(Action.SIGN_IN)],
    response_model=account_schemas.User,
    responses=refusals(401, 429),
    openapi_extra=PUBLIC
    | {"requestBody": {"required": True, "content": {"application/json": _BODY, _FORM: _FORM_BODY}}},
)
def sign_in(
    request: Request,
    body: Annotated[account_schemas.SignIn, Depends(_credentials)],
    db: Db,
    settings: Config,
    logins: OpenLogins,
    trail: OpenTrail,
    failures: Failures,
) -> Any:
    """Sign in with name, password and, if required, a code; the response sets the session cookie."""
    address = address_of(request)
    row = accounts.check_password(db, failures, trail, body.name, body.password, address)
    key = settings.second_factor_key
    proof = None if body.key is None else (site_of(request, behind_tls=settings.behind_tls), body.key)
    factor = accounts.check_code(db, key, failures, trail, row.id, body.code, proof, address)
    try:
        with db.write() as c:
            if factor is accounts.Factor.RECOVERY_CODE:
                left = {"left": second_factor.count_recovery(c, row.id)}
                audit.record(c, None, "user.recovery_code_used", "user", row.id, left)
            token = _open(c, logins, row, request, "sign_in", {"factor": factor.value})
    except OperationalError as error:
        session = logins.keep(row.id, read_token(request)) if refusal_of(error) else None
        if session is None:
            raise
        token = session
        trail.record_opened(_identity(row, token), "sign_in", "user", row.id, {"factor": factor.value})
    response: Response
    if request.headers.get("content-type", "").startswith(_FORM):
        response = RedirectResponse(local_path(body.next), status_code=303)
    else:
        response = JSONResponse(_USER.dump_python(user_answer(row), mode="json"))
    set_token(response, request, token)
    return response


@router.post(
    "/sign-in/security-key",
    dependencies=[require(Action.SIGN_IN)],
    response_model=account_schemas.KeyOptions,
    responses=refusals(401, 404, 429),
    openapi_extra=PUBLIC,
)
def ask_for_key(
    request: Request,
    body: account_schemas.KeyQuestion,
    db: Db,
    settings: Config,
    trail: OpenTrail,
    failures: Failures,
) -> account_schemas.KeyOptions:
    """Options for signing in with a security key, after the correct password; 404 if none is
    registered here.
    """
    row = accounts.check_password(db, failures, trail, body.name, body.password, address_of(request))
    with db.write() as c:
        options = begin_sign_in(c, site_of(request, behind_tls=settings.behind_tls), row.id)
    if options is None:
        raise Problem(404, "no_key", "No security key is set up for this account at this address.")
    return account_schemas.KeyOptions(options)


@router.post("/sign-out", status_code=204)
def sign_out(
    request: Request,
    logins: OpenLogins,
    trail: OpenTrail,
    user: Annotated[Identity, require(Action.USE_ACCOUNT)],
) -> Response:
    """End this sign-in."""
    logins.close(user.login_id)
    trail.record_opened(user, "sign_out", "user", user.user_id)
    response = Response(status_code=204)
    clear_token(response, request)
    return response


@router.post(
    "/set-up/{token}",
    status_code=201,
    dependencies=[require(Action.SET_UP)],
    response_model=account_schemas.User,
    responses=refusals(404, 409),
    openapi_extra=PUBLIC,
)
def set_up(
    token: str, body: account_schemas.SetUp, request: Request, db: Db, logins: OpenLogins, trail: OpenTrail
) -> Any:
    """Create the first administrator with the token of the printed link, and sign in."""
    with db.read() as c:
        valid = one_time.is_valid(c, token, "set_up")
    # hashing is slow: do it outside the transaction, and only for valid tokens
    hashed = hash_password(body.password) if valid else ""
    with _told(trail, request), db.write() as c:
        one_time.use(c, token, "set_up")
        row = accounts.create(c, body.name, body.display_name, Role.ADMIN, hashed)
        audit.record(c, None, "user.set_up", "user", row.id)
        session = _open(c, logins, row, request, "sign_in", {"factor": accounts.Factor.PASSWORD.value})
    response = JSONResponse(_USER.dump_python(user_answer(row), mode="json"), 201)
    set_token(response, request, session)
    return response


@router.get("/sign-in", response_model=account_schemas.SignInState)
def read_sign_in(
    logins: OpenLogins, user: Annotated[Identity, require(Action.WATCH_SIGN_IN)]
) -> account_schemas.SignInState:
    """Remaining time of this sign-in; the request does not prolong it."""
    return account_schemas.SignInState(name=user.name, left_s=round(logins.seconds_left(user.login_id), 1))


@router.get("/account", response_model=account_schemas.Account)
def read_account(user: Annotated[Identity, require(Action.USE_ACCOUNT)]) -> account_schemas.Account:
    """The signed-in user and the permitted actions."""
    return account_schemas.Account(
        id=user.user_id,
        name=user.name,
        display_name=user.display_name,
        role=user.role,
        actions=sorted(action for action in POLICY if user.may(action)),
    )


@router.post("/account/password", status_code=204, responses=refusals(429))
def change_password(
    body: account_schemas.PasswordChange,
    db: Db,
    logins: OpenLogins,
    proof: Proving,
) -> None:
    """Change the user's password; all other sign-ins of the user end."""
    proof.check_password(body.current)
    user = proof.who
    hashed = hash_password(body.password)
    with db.write() as c:
        accounts.change(c, user.user_id, {"password_hash": hashed})
        logins.end_all(c, user.user_id, but=user.login_id)
        audit.record(c, user, "user.password_changed", "user", user.user_id)


@router.put("/account/language", status_code=204)
def choose_language(
    body: account_schemas.LanguageChoice, db: Db, user: Annotated[Identity, require(Action.USE_ACCOUNT)]
) -> None:
    """Set the language of the pages; null = as requested by the browser."""
    with db.write() as c:
        accounts.change(c, user.user_id, {"language": body.language})
        audit.record(c, user, "user.language_chosen", "user", user.user_id, {"language": body.language})


@address_router.get("/sign-in/{token}", dependencies=[require(Action.SIGN_IN)])
def sign_in_once(token: str, request: Request, db: Db, logins: OpenLogins, trail: OpenTrail) -> Response:
    """Sign in with a printed one-time link and go to the patient list."""
    with _told(trail, request), db.write() as c:
        user_id = one_time.use(c, token, "sign_in")
        row = accounts.get(c, user_id or "")
        session = _open(c, logins, row, request, "sign_in.one_time", {})
    response = RedirectResponse("/patients", status_code=303)
    set_token(response, request, session)
    return response


def _open(
    c: Connection, logins: Logins, row: Row[Any], request: Request, action: str, detail: dict[str, str]
) -> str:
    token = logins.start(c, row.id, replaces=read_token(request))
    audit.record(c, _identity(row, token), action, "user", row.id, detail)
    return token


def _identity(row: Row[Any], token: str) -> Identity:
    return Identity(row.id, row.name, row.display_name, Role(row.role), token_hash(token))


@contextlib.contextmanager
def _told(trail: AuditTrail, request: Request) -> Iterator[None]:
    """Record the use of an invalid one-time link."""
    try:
        yield
    except one_time.LinkNotValid:
        trail.record_refused("sign_in.failed", "user", None, address_of(request))
        raise
