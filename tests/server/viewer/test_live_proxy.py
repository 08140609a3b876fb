"""Who gets the live figure of a session, and what reaches it, through the real server."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any
from uuid import uuid4

import httpx
import pytest
import viser
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.typing import Subprotocol

from sagittal.server.clinic import patients, sessions
from sagittal.server.live.hub import Hub
from sagittal.server.viewer.views import FigureView, FigureViews
from tests.server.viewer.conftest import Ward
from tests.server.viewer.pictures import picture

pytestmark = pytest.mark.anyio
VISER = Subprotocol(f"viser-v{viser.__version__}")


def views_of(ward: Ward) -> FigureViews:
    views: FigureViews = ward.clinic.app.state.views
    return views


def hub_of(ward: Ward) -> Hub:
    hub: Hub = ward.clinic.app.state.hub
    return hub


@pytest.fixture
async def session_id(ward: Ward) -> AsyncIterator[str]:
    """Separate session whose views are closed afterwards."""
    with ward.clinic.db.write() as c:
        patient_id = patients.create(c, None, code=f"L-{uuid4().hex[:8]}", height_m=1.8).id
        result = sessions.create(c, None, patient_id).id
    yield result
    await views_of(ward).close()


@asynccontextmanager
async def browser(ward: Ward) -> AsyncIterator[httpx.AsyncClient]:
    async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{ward.port}", trust_env=False) as client:
        yield client


async def opened(ward: Ward, headers: dict[str, str], session_id: str, dark: bool = False) -> str:
    """Address of the figure's page."""
    async with browser(ward) as client:
        answer = await client.get(f"/sessions/{session_id}/live/figure?dark={dark}", headers=headers)
        assert answer.status_code == 200, answer.text
        src: str = answer.json()["src"]
        return src


@asynccontextmanager
async def looking(ward: Ward, headers: dict[str, str], src: str) -> AsyncIterator[ClientConnection]:
    async with connect(
        ward.url(src.rstrip("/")), subprotocols=[VISER], additional_headers=headers, max_size=None, proxy=None
    ) as ws:
        await asyncio.wait_for(ws.recv(), 5)  # the scene
        yield ws


def the_view(ward: Ward, src: str) -> FigureView[Any]:
    return views_of(ward)._views[src.split("/")[2]]


@pytest.mark.slow
async def test_all_who_may_run_live_share_one_figure_per_theme(ward: Ward, session_id: str) -> None:
    mine = await opened(ward, ward.cookie("clinician"), session_id)
    assert await opened(ward, ward.cookie("admin"), session_id) == mine
    assert await opened(ward, ward.cookie("clinician"), session_id, dark=True) != mine
    assert await opened(ward, ward.cookie("clinician"), ward.session_id) != mine
    async with browser(ward) as client:
        for role in ("clinician", "admin"):
            page = await client.get(mine, headers=ward.cookie(role))
            assert page.status_code == 307  # to the page that all views share
            assert "frame-ancestors 'self'" in page.headers["content-security-policy"]


async def test_another_role_no_sign_in_and_a_foreign_page_do_not_get_it(ward: Ward, session_id: str) -> None:
    src = await opened(ward, ward.cookie(), session_id)
    async with browser(ward) as client:
        for headers, asking, looking_at in (
            ({}, 401, 401),
            (ward.cookie("assistant"), 403, 403),
            (ward.cookie("viewer"), 403, 404),  # may see replays, but live sessions are not for this role
        ):
            assert (
                await client.get(f"/sessions/{session_id}/live/figure", headers=headers)
            ).status_code == asking
            assert (await client.get(src, headers=headers)).status_code == looking_at
        unknown = await client.get(
            "/sessions/0123456789abcdef0123456789abcdef/live/figure", headers=ward.cookie()
        )
        assert unknown.status_code == 404
        assert unknown.json()["detail"]
    for headers, status in (
        ({}, 401),
        (ward.cookie("assistant"), 403),
        ({**ward.cookie(), "Origin": "http://evil.example"}, 403),
    ):
        with pytest.raises(InvalidStatus) as refused:
            async with connect(ward.url(src.rstrip("/")), additional_headers=headers, proxy=None):
                pass
        assert refused.value.response.status_code == status
    async with connect(
        ward.url(src.rstrip("/")), subprotocols=[VISER], additional_headers=ward.cookie("viewer"), proxy=None
    ) as ws:
        with pytest.raises(ConnectionClosed) as closed:
            await asyncio.wait_for(ws.recv(), 5)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 4404


async def test_pictures_reach_those_who_look_at_this_session_and_no_other(
    ward: Ward, session_id: str
) -> None:
    headers = ward.cookie()
    src, other_page = await opened(ward, headers, session_id), await opened(ward, headers, ward.session_id)
    async with looking(ward, headers, src) as mine, looking(ward, ward.cookie("admin"), other_page) as theirs:
        await _quiet(mine)
        await _quiet(theirs)
        hub_of(ward).room(session_id).show(picture(30))
        assert isinstance(await asyncio.wait_for(mine.recv(), 5), bytes)
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(theirs.recv(), 0.3)
        assert not the_view(ward, src).figure.is_grey
        assert the_view(ward, other_page).figure.is_grey
        await _come(lambda: the_view(ward, src).figure.is_grey)  # nothing more comes


async def test_who_comes_back_finds_the_same_figure_and_after_it_was_stopped_a_new_one(
    ward: Ward, session_id: str
) -> None:
    headers, hub = ward.cookie(), hub_of(ward)
    src = await opened(ward, headers, session_id)
    async with looking(ward, headers, src):
        hub.room(session_id).show(picture(30))
    async with looking(ward, headers, await opened(ward, headers, session_id)):
        assert await opened(ward, headers, session_id) == src
    room = hub.room(session_id)
    assert not room.is_empty
    views, view = views_of(ward), the_view(ward, src)
    await _come(lambda: view.viewers == 0)
    views._idle_s = 0.0
    try:
        await views.sweep()
    finally:
        views._idle_s = 30.0
    assert room.is_empty
    async with browser(ward) as client:
        assert (await client.get(src, headers=headers)).status_code == 404
    second_page = await opened(ward, headers, session_id)
    assert second_page != src
    async with looking(ward, headers, second_page):
        hub.room(session_id).show(picture(31))
        assert not the_view(ward, second_page).figure.is_grey


async def test_the_last_picture_is_there_for_who_opens_the_page_later(ward: Ward, session_id: str) -> None:
    headers = ward.cookie()
    first = await opened(ward, headers, session_id)
    async with looking(ward, headers, first):
        hub_of(ward).room(session_id).show(picture(40))
        dark = await opened(ward, headers, session_id, dark=True)
        async with looking(ward, headers, dark):
            await _come(lambda: the_view(ward, dark).figure._t_s is not None)
            assert the_view(ward, dark).figure._t_s == pytest.approx(40 / 30)


async def _come(label: Callable[[], bool]) -> None:
    """Wait for something."""
    async with asyncio.timeout(5):
        while not label():
            await asyncio.sleep(0.02)


async def _quiet(ws: ClientConnection) -> None:
    """Read until nothing comes any more."""
    while True:
        try:
            await asyncio.wait_for(ws.recv(), 0.2)
        except TimeoutError:
            return
