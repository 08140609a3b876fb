"""Proxies: users are counted by their own address, which they cannot forge."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import httpx
import pytest
from starlette.types import Receive, Scope, Send

from sagittal.server.settings import Settings
from tests.helpers.clinic import open_clinic
from tests.server.serving import serve

pytestmark = pytest.mark.anyio
PROXY = "127.0.0.9"
"""Another address of this machine than that which is always believed, as a container's proxy has."""
WRONG_CODES = 10


@asynccontextmanager
async def the_proxy(port: int, user: str, sender: str = PROXY) -> AsyncIterator[httpx.AsyncClient]:
    """Requests of a user as a proxy passes them on."""
    headers = {"X-Forwarded-For": user, "X-Forwarded-Proto": "https"}
    transport = httpx.AsyncHTTPTransport(local_address=sender)
    async with httpx.AsyncClient(
        base_url=f"http://127.0.0.1:{port}", transport=transport, headers=headers
    ) as client:
        yield client


async def wrong_codes(port: int, user: str, times: int = WRONG_CODES) -> list[int]:
    """Status for a user who enters invalid pairing codes."""
    async with the_proxy(port, user) as client:
        return [
            (await client.post("/api/v1/live/pairings", json={"code": "AAAAAA"})).status_code
            for _ in range(times)
        ]


async def test_one_users_wrong_guesses_do_not_lock_out_the_others_behind_a_proxy(tmp_path: Path) -> None:
    async with (
        open_clinic(tmp_path, behind_tls=True, trusted_proxies=("127.0.0.8/29",)) as clinic,
        serve(clinic.app, clinic.settings) as port,
    ):
        assert 429 not in await wrong_codes(port, "203.0.113.1")
        assert await wrong_codes(port, "203.0.113.1", 1) == [429]
        assert await wrong_codes(port, "203.0.113.2", 1) != [429]


@pytest.mark.slow
async def test_an_address_that_a_user_makes_up_is_not_believed(tmp_path: Path) -> None:
    """Proxies append the real address to forged headers."""
    async with (
        open_clinic(tmp_path, behind_tls=True, trusted_proxies=(PROXY,)) as clinic,
        serve(clinic.app, clinic.settings) as port,
    ):
        for i in range(WRONG_CODES):
            await wrong_codes(port, f"198.51.100.{i}, 203.0.113.1", 1)
        assert await wrong_codes(port, "198.51.100.99, 203.0.113.1", 1) == [429]


async def seen(scope: Scope, receive: Receive, send: Send) -> None:
    """Answers which client and scheme the application sees."""
    body = f"{scope['scheme']} {scope['client'][0]}".encode()
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": body})


@pytest.mark.parametrize(
    ("behind_tls", "trusted", "sender", "expected"),
    [
        (True, (), "127.0.0.1", "https 203.0.113.1"),
        (True, (), PROXY, f"http {PROXY}"),
        (True, (PROXY,), PROXY, "https 203.0.113.1"),
        (True, ("10.0.0.0/8",), PROXY, f"http {PROXY}"),
        (False, (PROXY,), PROXY, "https 203.0.113.1"),
        (False, (), "127.0.0.1", "http 127.0.0.1"),
    ],
)
async def test_only_trusted_proxies_say_who_the_client_is(
    behind_tls: bool, trusted: tuple[str, ...], sender: str, expected: str
) -> None:
    settings = Settings(behind_tls=behind_tls, trusted_proxies=trusted)
    async with serve(seen, settings) as port, the_proxy(port, "203.0.113.1", sender) as client:
        assert (await client.get("/")).text == expected


async def test_a_proxy_that_is_not_trusted_is_named_once_in_the_log(caplog: pytest.LogCaptureFixture) -> None:
    async with serve(seen, Settings(behind_tls=True)) as port:
        for user in ("203.0.113.1", "203.0.113.2"):
            async with the_proxy(port, user) as client:
                await client.get("/")
    (message,) = [m for m in caplog.messages if "SAGITTAL_TRUSTED_PROXIES" in m]
    assert PROXY in message
