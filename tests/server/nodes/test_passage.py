"""Forwarding header between web servers is valid for a single request."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from sagittal.server.nodes.known import KnownNodes
from sagittal.server.nodes.passage import ASKED_BY, HEADER, LIFE_S, write_line

pytestmark = pytest.mark.anyio

KEY = b"k" * 32
Scope = dict[str, Any]


def ask(client: str = "192.0.2.7") -> Scope:
    nodes = SimpleNamespace(name="a", key=KEY)
    return {
        "type": "http",
        "method": "POST",
        "path": "/api/v1/sessions/1/live/close",
        "raw_path": b"/api/v1/sessions/1/live/close",
        "query_string": b"",
        "scheme": "https",
        "client": (client, 40000),
        "headers": [(b"host", b"gait.clinic.example"), (b"cookie", b"sid=1"), (b"accept", b"*/*")],
        "app": SimpleNamespace(state=SimpleNamespace(nodes=nodes)),
        "state": {},
    }


def pass_on(requests: Scope, line: bytes) -> Scope:
    """What arrives: from the address of the other server, by plain HTTP."""
    headers = [*requests["headers"], (HEADER, line)]
    return {**requests, "client": ("10.0.0.2", 50000), "scheme": "http", "headers": headers}


async def see(scope: Scope) -> Scope | int:
    """Request as seen by the application, or the status of the refusal."""
    observations: list[Scope | int] = []

    async def app(scope: Any, receive: Any, send: Any) -> None:
        observations.append(scope)

    async def send(message: Any) -> None:
        with contextlib.suppress(KeyError):
            observations.append(message["status"])

    async def receive() -> Any:
        return {"type": "http.request", "body": b"", "more_body": False}

    await KnownNodes(app)(scope, receive, send)
    return observations[0]


async def test_what_another_server_passes_on_is_its_clients() -> None:
    observations = await see(pass_on(ask(), write_line(KEY, "b", "a", ask())))
    assert isinstance(observations, dict)
    assert (observations["client"][0], observations["scheme"], observations[ASKED_BY]) == (
        "192.0.2.7",
        "https",
        "b",
    )
    assert HEADER not in dict(observations["headers"])


async def test_without_a_line_nothing_is_believed() -> None:
    observations = await see(ask("10.0.0.2"))
    assert isinstance(observations, dict)
    assert ASKED_BY not in observations
    assert observations["client"][0] == "10.0.0.2"


CHANGES: dict[str, Callable[[Scope], Any]] = {
    "another address": lambda s: s.update(raw_path=b"/api/v1/sessions/2/live/close"),
    "another method": lambda s: s.update(method="GET"),
    "a query": lambda s: s.update(query_string=b"x=1"),
    "another cookie": lambda s: s["headers"].__setitem__(1, (b"cookie", b"sid=2")),
    "a token": lambda s: s["headers"].append((b"authorization", b"Bearer x")),
    "two lines": lambda s: s["headers"].append(s["headers"][-1]),
}


@pytest.mark.parametrize("change", CHANGES)
async def test_a_line_that_was_seen_serves_for_nothing_else(change: str) -> None:
    scope = pass_on(ask(), write_line(KEY, "b", "a", ask()))
    CHANGES[change](scope)
    assert await see(scope) == 403


async def test_lines_of_strangers_for_others_of_other_clients_and_old_ones_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    good = write_line(KEY, "b", "a", ask())
    bad = [
        write_line(b"x" * 32, "b", "a", ask()),
        write_line(KEY, "b", "c", ask()),
        good.replace(b"192.0.2.7", b"192.0.2.8"),
        good.rpartition(b";")[0],
        b"",
        b";;;;;",
        "b;a;0;1;http;ä".encode("latin-1"),
    ]
    assert [await see(pass_on(ask(), line)) for line in bad] == [403] * len(bad)
    now = time.time()
    monkeypatch.setattr(time, "time", lambda: now - LIFE_S - 5)
    old = write_line(KEY, "b", "a", ask())
    monkeypatch.undo()
    assert await see(pass_on(ask(), old)) == 403
