"""Translated texts for scripts."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path
from starlette.responses import Response

from sagittal.server.auth.access import require
from sagittal.server.auth.roles import Action
from sagittal.server.http.headers import KEPT
from sagittal.server.http.problems import SENTENCES, Problem
from sagittal.web.language import LANGUAGES, SOURCE, script_texts

router = APIRouter(include_in_schema=False)


@router.get("/texts/{language}/{version}.json", dependencies=[require(Action.LOAD_ASSET)])
def load_texts(
    language: Annotated[str, Path(max_length=8)], version: Annotated[str, Path(max_length=64)]
) -> Response:
    """The catalogue of one language; URLs of earlier versions return the current one."""
    if language not in LANGUAGES or language == SOURCE:
        raise Problem(404, "not_found", SENTENCES["not_found"])
    present, content = script_texts(language)
    cache_control = KEPT if version == present else "no-cache"
    return Response(content, media_type="application/json", headers={"Cache-Control": cache_control})
