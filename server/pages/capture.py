"""The page that turns a phone or tablet into the source of a live take; it is open to who has its code."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from server.auth.access import require
from server.auth.roles import Action
from server.http.templates import render
from server.pages.words import CALIBRATIONS, SEGMENT_NAMES
from server.services.live import ALPHABET, CODE_LENGTH

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

PLACES = ("chest", "pelvis", "thigh_r", "thigh_l", "shank_r", "shank_l", "foot_r", "foot_l")
"""As one sees the person from the front, top to bottom."""


@router.get("/capture", dependencies=[require(Action.PAIR)])
def show_capture(request: Request) -> Response:
    """Pair, place the sensors, record; knows no patient before the code is entered."""
    context = {
        "alphabet": ALPHABET,
        "code_length": CODE_LENGTH,
        "calibrations": CALIBRATIONS,
        "places": [(place, SEGMENT_NAMES[place]) for place in PLACES],
    }
    return render(request, "capture.html", context)
