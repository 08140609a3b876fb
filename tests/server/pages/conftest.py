"""Fixtures of pages."""

from __future__ import annotations

from collections.abc import AsyncIterator

import pytest

from tests.helpers.clinic import Clinic, open_clinic


@pytest.fixture(scope="module")
async def clinic(tmp_path_factory: pytest.TempPathFactory, anyio_backend: str) -> AsyncIterator[Clinic]:
    """One running application a file."""
    async with open_clinic(tmp_path_factory.mktemp("clinic")) as running:
        yield running
