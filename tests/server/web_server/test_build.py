"""Headers present and absent in every response of the web server."""

from __future__ import annotations

from pathlib import Path

import httpx
import pytest

from tests.helpers.clinic import open_clinic
from tests.server.serving import serve

pytestmark = pytest.mark.anyio


async def test_no_answer_names_the_server_software(tmp_path: Path) -> None:
    async with (
        open_clinic(tmp_path) as clinic,
        serve(clinic.app) as port,
        httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", trust_env=False) as client,
    ):
        for path in ("/health/live", "/sign-in", "/nothing", "/api/v1/patients"):
            assert "server" not in (await client.get(path)).headers, path
