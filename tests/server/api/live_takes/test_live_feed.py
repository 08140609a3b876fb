"""Live feed of a session: permissions, initial messages, closing."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator

import pytest
import websockets

from sagittal.server.api.live_takes.live_feed import GONE
from tests.helpers.clinic import Clinic
from tests.helpers.live_clinic import closed, heard, visit
from tests.server.serving import serve
from tests.server.sockets import ask_websocket

pytestmark = pytest.mark.anyio


@pytest.fixture(scope="module")
async def port(clinic: Clinic) -> AsyncIterator[int]:
    async with serve(clinic.app) as number:
        yield number


async def test_a_browser_hears_first_where_the_take_stands_and_then_what_happens(
    clinic: Clinic, port: int
) -> None:
    async with visit(clinic, port) as v, v.feed() as page, v.feed() as other_feed:
        for one in (page, other_feed):
            first = json.loads(await one.recv())
            assert (first["type"], first["take"], first["state"]) == ("state", v.take, "open")
        await v.http.post(f"{v.api}/close")
        for one in (page, other_feed):
            assert (await heard(one, "state", state="closed"))["take"] == v.take
    async with clinic.client("admin") as admin:
        rows = (await admin.get("/api/v1/audit")).json()
    assert [r["resource_id"] for r in rows if r["action"] == "live.watched"] == [v.session] * 2, (
        "of each sign-in"
    )


async def test_of_a_session_that_is_gone_nothing_is_told(clinic: Clinic, port: int) -> None:
    missing = f"ws://127.0.0.1:{port}/sessions/{'0' * 32}/live/feed"
    cookie = {"Cookie": f"sid={clinic.token('clinician')}"}
    async with websockets.connect(missing, additional_headers=cookie) as page:
        assert (await closed(page))[0] == GONE


async def test_who_may_not_run_live_takes_watches_none(clinic: Clinic) -> None:
    path = f"/sessions/{'0' * 32}/live/feed"
    assert await ask_websocket(clinic.app, path, {}) in {401, 403}
    assert await ask_websocket(clinic.app, path, {"Cookie": f"sid={clinic.token('viewer')}"}) == 403
