from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import httpx
import msgspec
import pytest
import viser
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.typing import Subprotocol

from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Role
from sagittal.server.report.view.no_figure import FEW_SENSORS
from sagittal.server.viewer import pipe
from sagittal.server.viewer.room import VIEWS
from sagittal.server.viewer.views import FigureView, FigureViews
from tests.server.viewer.conftest import Ward

pytestmark = pytest.mark.anyio
VISER = Subprotocol(f"viser-v{viser.__version__}")


def views_of(ward: Ward) -> FigureViews:
    views: FigureViews = ward.clinic.app.state.views
    return views


@asynccontextmanager
async def replaying(
    ward: Ward, headers: dict[str, str], session_id: str | None = None, tab: str = "one"
) -> AsyncIterator[tuple[ClientConnection, dict[str, object]]]:
    url = ward.url(f"/sessions/{session_id or ward.session_id}/replay?tab={tab}")
    async with connect(url, additional_headers=headers, proxy=None) as ws:
        yield ws, json.loads(await ws.recv())


async def ask(ws: ClientConnection, message: object) -> dict[str, object]:
    await ws.send(message if isinstance(message, str) else json.dumps(message))
    answer: dict[str, object] = json.loads(await ws.recv())
    return answer


@pytest.mark.slow
async def test_replay_poses_the_figure_at_the_time_of_the_page(ward: Ward) -> None:
    headers = ward.cookie()
    async with replaying(ward, headers) as (ws, opened):
        assert opened["src"] == f"/views/{opened['view']}/"
        assert opened["duration_s"] == pytest.approx(11.98)
        assert await ask(ws, {"t": 3.001}) == {"t": pytest.approx(3.0), "valid": True}
        assert (await ask(ws, {"t": 1e9}))["t"] == pytest.approx(11.98)
        assert opened["placed"] is opened["measured"] is True
        for switch in ("dark", "follow", "ground"):
            assert await ask(ws, {switch: True}) == {switch: True}
            assert await ask(ws, {switch: False}) == {switch: False}


async def test_the_view_can_be_from_any_side_and_says_what_is_laid_over(ward: Ward) -> None:
    async with replaying(ward, ward.cookie(), tab="looks") as (ws, opened):
        assert opened["hidden"] == []
        for view in VIEWS:
            assert await ask(ws, {"look": view}) == {"look": view}
        # of this analysis there are poses only, no stride: nothing can be laid over, and it says why
        for ghost in ("norm", "left", "right"):
            answer = await ask(ws, {"ghost": ghost})
            assert answer["ghost"] is None
            assert "analysis.json" in str(answer["why"])
        assert await ask(ws, {"ghost": None}) == {"ghost": None}
        for wrong in ({"look": "below"}, {"ghost": "visit"}, {"ghost": True}, {"look": ["near"]}):
            answer = await ask(ws, wrong)
            assert answer["error"]["code"] == "bad_message"  # type: ignore[index]


@pytest.mark.parametrize(
    "message", ["", "[]", '{"t": NaN}', '{"t": "1"}', '{"t": true}', '{"x": 1}', '{"follow": 1}', "{"]
)
async def test_a_message_that_makes_no_sense_is_answered_not_fatal(ward: Ward, message: str) -> None:
    async with replaying(ward, ward.cookie(), tab="odd") as (ws, _):
        answer = await ask(ws, message)
        assert answer["error"]["code"] == "bad_message"  # type: ignore[index]
        assert (await ask(ws, {"t": 1.0}))["t"] == pytest.approx(1.0)


async def test_a_session_without_poses_says_so(ward: Ward) -> None:
    async with replaying(ward, ward.cookie(), ward.empty_session_id) as (ws, answer):
        assert answer["error"]["code"] == "no_poses"  # type: ignore[index]
        assert "nothing is analysed yet" in str(answer["error"])
        with pytest.raises(ConnectionClosed) as closed:
            await ws.recv()
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 4404


async def test_an_analysis_without_a_figure_does_not_read_as_pending(ward: Ward) -> None:
    async with replaying(ward, ward.cookie(), ward.trunk_session_id) as (_, answer):
        assert answer["error"]["code"] == "no_poses"  # type: ignore[index]
        assert FEW_SENSORS in str(answer["error"])
        assert "yet" not in FEW_SENSORS


async def test_a_tab_gets_its_own_view_and_a_reload_the_same(ward: Ward) -> None:
    headers = ward.cookie()
    async with replaying(ward, headers, tab="a") as (_, first):
        pass
    async with (
        replaying(ward, headers, tab="a") as (_, repeat),
        replaying(ward, headers, tab="b") as (_, second),
    ):
        assert first["view"] == repeat["view"]
        assert second["view"] != repeat["view"]


async def test_a_page_may_load_the_client_while_its_view_is_being_opened(ward: Ward) -> None:
    headers, name = ward.cookie(), "0123456789abcdef" * 2

    async def first_of_scene() -> object:
        async with piped(ward, headers, name) as ws:
            return await ws.recv()

    early = asyncio.create_task(first_of_scene())
    await asyncio.sleep(0.05)  # it waits, the view is not there yet
    url = ward.url(f"/sessions/{ward.session_id}/replay?tab=early&t=3.0&view={name}")
    async with connect(url, additional_headers=headers, proxy=None) as cursor:
        assert json.loads(await cursor.recv())["view"] == name
        assert isinstance(await asyncio.wait_for(early, 5), bytes)
        view = views_of(ward).find(name, *_login_of(ward, headers))
        assert view is not None
        assert view is views_of(ward).find(view.id, *_login_of(ward, headers))
    selection = {**ward.cookie("admin")}
    async with connect(url, additional_headers=selection, proxy=None) as theirs:
        assert json.loads(await theirs.recv())["view"] != name, "of somebody else the name is not heard"


async def test_page_is_served_to_its_own_sign_in_only_and_with_its_own_policy(ward: Ward) -> None:
    headers = ward.cookie()
    async with (
        replaying(ward, headers) as (_, opened),
        httpx.AsyncClient(base_url=f"http://127.0.0.1:{ward.port}", trust_env=False) as client,
    ):
        src = str(opened["src"])
        led = await client.get(src, headers=headers)
        assert led.headers["location"].endswith(f"#{opened['view']}")
        gzip = {"Accept-Encoding": "gzip"}
        page = await client.get(led.headers["location"], headers=gzip)  # no data of anybody: kept by browsers
        assert page.headers["cache-control"].endswith("immutable")
        older = await client.get("/views/client/0123", headers=gzip)
        assert older.headers["cache-control"] == "no-cache"
        assert older.text == page.text
        assert "frame-ancestors 'self'" in page.headers["content-security-policy"]
        assert "http" not in page.headers["content-security-policy"]
        assert ".mantine-Paper-root" in page.text
        assert (await client.get(src)).status_code == 401
        assert (await client.get(src, headers=ward.cookie())).status_code == 404
        assert (await client.get(src, headers=ward.cookie("assistant"))).status_code == 403


@asynccontextmanager
async def piped(
    ward: Ward, headers: dict[str, str], view: object, protocol: str = VISER
) -> AsyncIterator[ClientConnection]:
    url = ward.url(f"/views/{view}")
    async with connect(
        url, subprotocols=[Subprotocol(protocol)], additional_headers=headers, max_size=None, proxy=None
    ) as ws:
        yield ws


async def test_pipe_carries_the_scene(ward: Ward) -> None:
    headers = ward.cookie()
    async with replaying(ward, headers) as (cursor, opened), piped(ward, headers, opened["view"]) as ws:
        assert ws.subprotocol == VISER
        assert isinstance(await asyncio.wait_for(ws.recv(), 5), bytes)
        await ask(cursor, {"t": 5.0})
        assert isinstance(await asyncio.wait_for(ws.recv(), 5), bytes)


async def test_websockets_need_a_sign_in_a_role_and_our_own_origin(ward: Ward) -> None:
    foreign = {**ward.cookie(), "Origin": "http://evil.example"}
    for headers, status in (({}, 401), (ward.cookie("assistant"), 403), (foreign, 403)):
        for path in (f"/sessions/{ward.session_id}/replay", "/views/0123"):
            with pytest.raises(InvalidStatus) as refused:
                async with connect(ward.url(path), additional_headers=headers, proxy=None):
                    pass
            assert refused.value.response.status_code == status


async def test_a_view_of_somebody_else_is_not_there(ward: Ward) -> None:
    async with replaying(ward, ward.cookie()) as (_, opened):
        async with piped(ward, ward.cookie("admin"), opened["view"]) as ws:
            with pytest.raises(ConnectionClosed) as closed:
                await asyncio.wait_for(ws.recv(), 5)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 4404


async def test_a_view_whose_viser_has_died_is_gone_too(ward: Ward) -> None:
    headers = ward.cookie()
    async with replaying(ward, headers, tab="dying") as (_, opened):
        view = views_of(ward).find(str(opened["view"]), *_login_of(ward, headers))
        assert view is not None
        await asyncio.to_thread(view.server.stop)
        async with piped(ward, headers, opened["view"]) as ws:
            assert await asyncio.wait_for(_close_code(ws), 5) == 4404


async def test_close_code_of_viser_reaches_the_browser(ward: Ward) -> None:
    headers = ward.cookie()
    async with replaying(ward, headers) as (_, opened):
        async with piped(ward, headers, opened["view"], "viser-v0.0.1") as ws:
            with pytest.raises(ConnectionClosed) as closed:
                await asyncio.wait_for(ws.recv(), 5)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1002


async def test_sign_out_ends_the_view(ward: Ward, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sagittal.server.auth.access.CHECK_EVERY_S", 0.05)
    headers = ward.cookie("viewer")
    async with replaying(ward, headers) as (cursor, opened), piped(ward, headers, opened["view"]) as ws:
        with ward.clinic.db.write() as c:
            ward.clinic.app.state.logins.end_all(c, ward.clinic.user("viewer"))
        for connection in (ws, cursor):
            assert await asyncio.wait_for(_close_code(connection), 5) == 1008


async def _close_code(connection: ClientConnection) -> int | None:
    with contextlib.suppress(ConnectionClosed):
        async for _ in connection:
            pass
    return connection.close_code


def test_only_camera_messages_pass_upward() -> None:
    def message(kind: str) -> bytes:
        return msgspec.msgpack.encode({"type": kind})

    assert pipe.is_allowed(message("ViewerCameraMessage"))
    for forged in ("ShareUrlRequest", "GuiUpdateMessage", "", "ViewerCameraMessage "):
        assert not pipe.is_allowed(message(forged))
    for junk in (b"", b"\xc1", msgspec.msgpack.encode([1]), msgspec.msgpack.encode("ViewerCameraMessage")):
        assert not pipe.is_allowed(junk)


async def test_a_forged_request_to_share_never_reaches_viser(ward: Ward) -> None:
    headers = ward.cookie()
    async with replaying(ward, headers) as (_, opened):
        view = views_of(ward).find(str(opened["view"]), *_login_of(ward, headers))
        assert isinstance(view, FigureView)
        names: list[str] = []
        handle = view.server._websock_server._handle_incoming_message

        async def spy(client: object, message: object) -> None:
            names.append(type(message).__name__)
            await handle(client, message)

        view.server._websock_server._handle_incoming_message = spy
        async with piped(ward, headers, opened["view"]) as ws:
            await asyncio.wait_for(ws.recv(), 5)
            await ws.send(msgspec.msgpack.encode({"type": "ShareUrlRequest"}))
            await ws.send(msgspec.msgpack.encode(_camera()))
            for _ in range(100):
                if names:
                    break
                await asyncio.sleep(0.02)
        assert names
        assert set(names) == {"ViewerCameraMessage"}


def _camera() -> dict[str, object]:
    return {
        "type": "ViewerCameraMessage",
        "wxyz": (1.0, 0.0, 0.0, 0.0),
        "position": (0.0, 0.0, 1.0),
        "fov": 0.6,
        "near": 0.01,
        "far": 100.0,
        "image_height": 100,
        "image_width": 100,
        "look_at": (0.0, 0.0, 0.0),
        "up_direction": (0.0, 0.0, 1.0),
    }


def _login_of(ward: Ward, headers: dict[str, str]) -> tuple[str, Role]:
    user: Identity = ward.clinic.app.state.logins.find(headers["Cookie"].removeprefix("sid="))
    return user.login_id, user.role
