"""A websocket asked for without a server: whether it is accepted, or with what status refused."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fastapi import FastAPI

from tests.helpers.clinic import ORIGIN


async def ask_websocket(app: FastAPI, path: str, headers: Mapping[str, str]) -> int:
    """Status of the refusal, 200 = accepted; whoever asks goes away at once."""
    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)

    async def receive() -> Any:
        accepted = any(m["type"] == "websocket.accept" for m in sent)
        return {"type": "websocket.disconnect", "code": 1001} if accepted else {"type": "websocket.connect"}

    own = [(name.lower().encode(), value.encode()) for name, value in headers.items()]
    scope = {
        "type": "websocket",
        "path": path,
        "raw_path": path.encode(),
        "query_string": b"",
        "scheme": "ws",
        "root_path": "",
        "headers": [(b"host", b"127.0.0.1"), (b"origin", ORIGIN.encode()), *own],
        "subprotocols": [],
        "client": ("127.0.0.1", 1),
        "server": ("127.0.0.1", 80),
        "extensions": {"websocket.http.response": {}},
    }
    await app(scope, receive, send)
    first = sent[0]
    return int(first.get("status", 403)) if first["type"] != "websocket.accept" else 200
