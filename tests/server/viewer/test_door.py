"""Whoever does not come through the clinic's own door gets nothing of a 3D view."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import pytest
import viser
from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException
from websockets.typing import Subprotocol

from sagittal.server.viewer.views import FigureViews
from tests.server.viewer.conftest import Ward

pytestmark = pytest.mark.anyio
VISER = Subprotocol(f"viser-v{viser.__version__}")
LISTENING = "0A"


def listening_ports() -> set[int]:
    """TCP ports that this process listens on."""
    mine = set()
    for entry in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # the one that lists them
            mine.add(str(entry.readlink()))
    ports = set()
    for table in (Path("/proc/self/net/tcp"), Path("/proc/self/net/tcp6")):
        if table.exists():
            for line in table.read_text("ascii").splitlines()[1:]:
                _, address, _, state, *_, inode = line.split()[:10]
                if state == LISTENING and f"socket:[{inode}]" in mine:
                    ports.add(int(address.rpartition(":")[2], 16))
    return ports


async def gained_at(port: int) -> list[object]:
    """Response to a local process or page without a cookie."""
    gained: list[object] = []
    async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", trust_env=False) as client:
        with contextlib.suppress(httpx.HTTPError):
            gained.append((await client.get("/")).status_code)
    with contextlib.suppress(OSError, WebSocketException, TimeoutError):
        async with connect(f"ws://127.0.0.1:{port}", subprotocols=[VISER], max_size=None, proxy=None) as ws:
            gained.append("a websocket")
            gained.append(await asyncio.wait_for(ws.recv(), 5))
    with contextlib.suppress(OSError):
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        gained.append("a connection")
        writer.close()
    return gained


@pytest.fixture
def headers(ward: Ward) -> dict[str, str]:
    return ward.cookie()


@pytest.fixture
async def views_open(ward: Ward, headers: dict[str, str]) -> AsyncIterator[list[str]]:
    """Pages of a replay and of a live figure in both themes, all open."""
    replay = ward.url(f"/sessions/{ward.session_id}/replay?tab=door")
    async with (
        connect(replay, additional_headers=headers, proxy=None) as ws,
        httpx.AsyncClient(base_url=f"http://127.0.0.1:{ward.port}", trust_env=False) as client,
    ):
        sources = [json.loads(await ws.recv())["src"]]
        for dark in (True, False):
            answer = await client.get(f"/sessions/{ward.session_id}/live/figure?dark={dark}", headers=headers)
            sources.append(answer.raise_for_status().json()["src"])
        yield sources
    await views_of(ward).close()


def views_of(ward: Ward) -> FigureViews:
    views: FigureViews = ward.clinic.app.state.views
    return views


@pytest.fixture
def ports_before() -> set[int]:
    """What other tests of this process serve."""
    return listening_ports()


@pytest.mark.slow
async def test_no_port_of_this_machine_gives_a_view_away(
    ports_before: set[int], ward: Ward, views_open: list[str]
) -> None:
    ports = listening_ports()
    assert ward.port in ports
    opened = ports - ports_before - {ward.port}
    assert {port: gained for port in opened if (gained := await gained_at(port))} == {}


async def test_every_view_comes_through_the_door_with_a_cookie(
    ward: Ward, headers: dict[str, str], views_open: list[str]
) -> None:
    for source in views_open:
        async with connect(
            ward.url(source.rstrip("/")),
            subprotocols=[VISER],
            additional_headers=headers,
            max_size=None,
            proxy=None,
        ) as ws:
            assert isinstance(await asyncio.wait_for(ws.recv(), 5), bytes)
