"""Pages before sign-in: the sign-in form, and set-up of the first account."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, RedirectResponse
from starlette.responses import Response

from sagittal.server.auth import one_time
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.passwords import MIN_LENGTH
from sagittal.server.auth.roles import Action
from sagittal.server.context import Db
from sagittal.server.http.local_path import local_path
from sagittal.server.http.templates import render

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


@router.get("/")
def go_home(user: Annotated[Identity, require(Action.READ_PATIENT)]) -> Response:
    """Redirect to the patient list."""
    return RedirectResponse("/patients", status_code=303)


@router.get("/sign-in", dependencies=[require(Action.SIGN_IN)])
def show_sign_in(request: Request, next: Annotated[str, Query(max_length=2000)] = "/patients") -> Response:  # noqa: A002 - the name in the address
    """Sign-in form."""
    return render(request, "sign-in.html", {"next": local_path(next)})


@router.get("/set-up/{token}", dependencies=[require(Action.SET_UP)])
def show_set_up(request: Request, db: Db, token: str) -> Response:
    """Form for creating the first account, at the link printed at the first start."""
    with db.read() as c:
        valid = one_time.is_valid(c, token, "set_up")
    context = {"token": token, "valid": valid, "min_password": MIN_LENGTH}
    return render(request, "set-up.html", context, status_code=200 if valid else 404)
