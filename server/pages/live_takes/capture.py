"""Page that makes a phone or tablet the source of a live trial; accessible with its code."""

from __future__ import annotations

from typing import Final

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from sagittal.server.auth.access import require
from sagittal.server.auth.roles import Action
from sagittal.server.context import Config
from sagittal.server.http.headers import allow_camera
from sagittal.server.http.templates import render
from sagittal.server.live_takes.live import ALPHABET, CODE_LENGTH
from sagittal.server.pages.words import CALIBRATIONS, SEGMENT_NAMES

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

PLACES = ("chest", "pelvis", "thigh_r", "thigh_l", "shank_r", "shank_l", "foot_r", "foot_l")
"""As seen from the front, top to bottom."""


FILM_BITS_PER_S: Final = 1_500_000
"""Bit rate requested from the browser's recorder."""


@router.get("/capture", dependencies=[require(Action.PAIR)])
def show_capture(request: Request, settings: Config) -> Response:
    """Pair, place the sensors, record; contains no patient data before the code is entered."""
    context = {
        "film_bits_per_s": FILM_BITS_PER_S,
        "film_limit_bytes": settings.max_file_bytes,
        "film_minutes": int(settings.max_file_bytes * 8 / FILM_BITS_PER_S / 60),
        "alphabet": ALPHABET,
        "code_length": CODE_LENGTH,
        "calibrations": CALIBRATIONS,
        "places": [(place, SEGMENT_NAMES[place]) for place in PLACES],
    }
    # the only page with access to the camera
    headers = {"Permissions-Policy": allow_camera("(self)")}
    return render(request, "capture.html", context, headers=headers)
