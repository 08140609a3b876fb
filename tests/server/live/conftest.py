from __future__ import annotations

from collections.abc import AsyncIterator

import pytest

from tests.helpers.clinic import Clinic, open_clinic
from tests.server.serving import serve


@pytest.fixture(scope="module")
async def clinic(tmp_path_factory: pytest.TempPathFactory, anyio_backend: str) -> AsyncIterator[Clinic]:
    """A clinic whose takes are recorded and not estimated."""
    async with open_clinic(tmp_path_factory.mktemp("clinic"), live_workers=0) as running:
        yield running


@pytest.fixture(scope="module")
async def port(clinic: Clinic) -> AsyncIterator[int]:
    async with serve(clinic.app) as number:
        yield number
