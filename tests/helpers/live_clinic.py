"""A tablet and a therapist at a running clinic, over real sockets."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator
from dataclasses import dataclass, replace
from typing import Any

import httpx
import websockets
from websockets.asyncio.client import ClientConnection

from sagittal.core.formats.live_log import PROTOCOL, Hello, hello_json
from sagittal.server.clinic import patients, sessions
from sagittal.server.storage.schema.tables import new_id
from tests.helpers.clinic import Clinic
from tests.helpers.live_takes import HELLO

PATIENCE_S = 20.0


@dataclass
class Visit:
    """A session with an open take, a therapist and a tablet that has paired."""

    clinic: Clinic
    port: int
    session: str
    take: str
    token: str
    http: httpx.AsyncClient

    @property
    def socket(self) -> str:
        return f"ws://127.0.0.1:{self.port}/api/v1/live"

    @property
    def api(self) -> str:
        return f"/api/v1/sessions/{self.session}/live"

    def hello(self, hello: Hello = HELLO, token: str | None = None) -> str:
        return hello_json(replace(hello, take=self.take), token or self.token).decode()

    @contextlib.asynccontextmanager
    async def tablet(self, hello: str | None = None) -> AsyncIterator[ClientConnection]:
        """Socket after its hello."""
        async with websockets.connect(self.socket, subprotocols=[PROTOCOL], compression=None) as ws:  # type: ignore[list-item]
            await ws.send(hello or self.hello())
            yield ws

    @contextlib.asynccontextmanager
    async def feed(self, role: str = "clinician") -> AsyncIterator[ClientConnection]:
        """A browser's socket."""
        url = f"ws://127.0.0.1:{self.port}/sessions/{self.session}/live/feed"
        cookie = {"Cookie": f"sid={self.clinic.token(role)}"}
        async with websockets.connect(url, additional_headers=cookie, compression=None) as ws:
            yield ws

    async def command(self, name: str, value: Any = None) -> dict[str, Any]:
        answer = await self.http.post(f"{self.api}/commands", json={"command": name, "value": value})
        answer.raise_for_status()
        return dict(answer.json())

    async def state(self) -> dict[str, Any]:
        return dict((await self.http.get(self.api)).raise_for_status().json())


def new_session(clinic: Clinic, **values: Any) -> str:
    """Session of a new patient."""
    with clinic.db.write() as c:
        patient = patients.create(c, None, code=f"L-{new_id()[:8]}", height_m=1.75)
        return sessions.create(c, None, patient.id, title="Live training", **values).id


async def open_code(http: httpx.AsyncClient, session: str) -> str:
    answer = await http.post(f"/api/v1/sessions/{session}/live")
    answer.raise_for_status()
    return str(answer.json()["code"])


@contextlib.asynccontextmanager
async def visit(clinic: Clinic, port: int, session: str | None = None) -> AsyncIterator[Visit]:
    """Open a take and pair."""
    session = session or new_session(clinic)
    cookies = {"sid": clinic.token("clinician")}
    base = f"http://127.0.0.1:{port}"
    async with httpx.AsyncClient(base_url=base, cookies=cookies, trust_env=False) as http:
        code = await open_code(http, session)
        paired = (await http.post("/api/v1/live/pairings", json={"code": code})).raise_for_status().json()
        yield Visit(clinic, port, session, paired["take"], paired["token"], http)


async def heard(ws: ClientConnection, kind: str, **wanted: Any) -> dict[str, Any]:
    """Next message of a type with these members; earlier ones are skipped."""
    async with asyncio.timeout(PATIENCE_S):
        while True:
            message = json.loads(await ws.recv())
            if message["type"] == kind and all(message.get(k) == v for k, v in wanted.items()):
                return dict(message)


async def closed(ws: ClientConnection) -> tuple[int, str]:
    """Close code and reason; earlier messages are skipped."""
    async with asyncio.timeout(PATIENCE_S):
        with contextlib.suppress(websockets.exceptions.ConnectionClosedError):
            async for _ in ws:
                pass
    return ws.close_code or 0, ws.close_reason or ""
