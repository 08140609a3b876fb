"""Assets loaded by the pages."""

from __future__ import annotations

import pytest

from sagittal.server.auth.roles import PUBLIC
from sagittal.server.pages.assets import STATIC, Assets
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio


async def test_browsers_keep_a_file_and_ask_whether_it_is_still_the_same(clinic: Clinic) -> None:
    path = "/static/js/forms.js"
    async with clinic.client() as client:
        first = await client.get(path)
        second_response = await client.get(path, headers={"if-none-match": first.headers["etag"]})
        nothing = [await client.get(f"/static/{p}") for p in ("nothing.js", "..%2f__init__.py", "")]
    assert first.content == (STATIC / "js/forms.js").read_bytes()
    assert (first.headers["cache-control"], second_response.status_code, second_response.content) == (
        "no-cache",
        304,
        b"",
    )
    assert {a.status_code for a in nothing} == {404}
    assert Assets.action in PUBLIC
