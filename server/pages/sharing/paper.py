"""Self-contained documents: printed pages with inline styles, without scripts."""

from __future__ import annotations

import base64
import functools
import hashlib
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from markupsafe import Markup
from starlette.requests import Request
from starlette.responses import Response

from sagittal.core.user_text import UserText
from sagittal.server.http.headers import allow_camera, lock_document
from sagittal.server.http.templates import TEMPLATES, language_of
from sagittal.server.pages.assets import STATIC
from sagittal.server.pages.words import PROTOCOL_NAMES
from sagittal.server.settings import Settings
from sagittal.server.sharing import pdfs

SHEETS: Final = ("base", "pages", "visits", "daily", "paper")
"""Style sheets for print, in order."""

_STYLE: Final = re.compile(r"<style>(.*?)</style>", re.DOTALL)


@functools.cache
def read_styles() -> str:
    """Combined style sheets for print."""
    return "\n".join((STATIC / "css" / f"{name}.css").read_text("utf-8") for name in SHEETS)


def write_document(language: str, template: str, context: Mapping[str, Any]) -> bytes:
    """Write a self-contained document: a signed report, or the source of a PDF."""
    page = TEMPLATES[language].get_template(template)
    return page.render({**context, "styles": Markup(read_styles())}).encode()  # noqa: S704 - ours


def hide_person(context: Mapping[str, Any], number: str) -> dict[str, Any]:
    """Context of a report without identifying data: a number replaces the patient's code."""
    patient, session, report = context["patient"], context["session"], context["report"]
    number = UserText(number)
    title = PROTOCOL_NAMES.get(session.protocol, session.protocol)
    identity = [(k, number if v == patient.code else v) for k, v in report["identity"]]
    return {
        **context,
        "patient": replace(patient, code=number, note=""),
        "session": replace(session, patient_code=number, title=title, note=""),
        "report": {**report, "identity": identity},
    }


def show_document(content: bytes, *, is_shared: bool = False) -> Response:
    """Response with a self-contained document that loads nothing and runs no scripts.

    Parameters
    ----------
    is_shared : for a reader without an account; sends no referrer to linked pages.
    """
    match = _STYLE.search(content.decode())
    digest = hashlib.sha256((match[1] if match else "").encode()).digest()
    headers = {
        "Content-Security-Policy": lock_document(base64.b64encode(digest).decode()),
        "Permissions-Policy": allow_camera("()"),
        "X-Robots-Tag": "noindex, nofollow, noarchive",
    }
    if is_shared:
        headers["Referrer-Policy"] = "no-referrer"
    return Response(content, media_type="text/html; charset=utf-8", headers=headers)


def print_pdf(
    request: Request, settings: Settings, template: str, context: Mapping[str, Any], name: str
) -> Response:
    """Response with a template's document as PDF, in the user's language; raises like `pdfs.make_pdf`."""
    document = write_document(language_of(request), template, context)
    return show_pdf(pdfs.make_pdf(settings, document), name)


def show_pdf(content: bytes, name: str) -> Response:
    """Response with a PDF displayed in the browser."""
    headers = {"Content-Disposition": f'inline; filename="{name}"'}
    return Response(content, media_type="application/pdf", headers=headers)
