"""Static files of pages: style sheets, scripts and icons."""

from __future__ import annotations

import os
from pathlib import Path

from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from sagittal import web
from sagittal.server.auth.roles import Action

STATIC = Path(web.__file__).parent / "static"


class Assets(StaticFiles):
    """Style sheets, scripts and icons; browsers cache and revalidate them."""

    action = Action.LOAD_ASSET

    def file_response(
        self,
        full_path: str | os.PathLike[str],
        stat_result: os.stat_result,
        scope: Scope,
        status_code: int = 200,
    ) -> Response:
        """Require caches to revalidate, as file names carry no version."""
        response = super().file_response(full_path, stat_result, scope, status_code)
        response.headers["Cache-Control"] = "no-cache"
        return response
