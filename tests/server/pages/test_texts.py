"""The texts of scripts in another language: kept for ever under their version."""

from __future__ import annotations

import pytest

from sagittal.server.http.headers import KEPT
from sagittal.web.language import LANGUAGES, SOURCE, script_texts
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio


async def test_a_version_is_kept_for_ever_and_an_earlier_one_gets_the_present_texts(clinic: Clinic) -> None:
    async with clinic.client() as client:
        for language in set(LANGUAGES) - {SOURCE}:
            version, content = script_texts(language)
            present = await client.get(f"/texts/{language}/{version}.json")
            earlier = await client.get(f"/texts/{language}/0.json")
            assert (present.status_code, present.content) == (200, content)
            assert present.headers["content-type"] == "application/json"
            assert (present.headers["cache-control"], earlier.headers["cache-control"]) == (KEPT, "no-cache")
            assert earlier.content == content


@pytest.mark.parametrize("language", [SOURCE, "xx", "..%2f"])
async def test_of_the_language_of_the_sources_and_of_none_there_is_nothing(
    clinic: Clinic, language: str
) -> None:
    async with clinic.client() as client:
        assert (await client.get(f"/texts/{language}/0.json")).status_code == 404
