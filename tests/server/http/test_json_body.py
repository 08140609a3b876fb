"""Bodies of requests by the one rule for JSON from outside."""

from __future__ import annotations

from typing import Any

import httpx
import pytest
from fastapi import APIRouter, Body, FastAPI

from sagittal.server.http.json_body import StrictJsonRoute

pytestmark = pytest.mark.anyio


def echo(router: APIRouter) -> FastAPI:
    @router.post("/")
    def answer(body: Any = Body()) -> Any:  # noqa: B008 - how FastAPI is told
        return body

    app = FastAPI()
    app.include_router(router)
    return app


STRICT, USUAL = echo(APIRouter(route_class=StrictJsonRoute)), echo(APIRouter())


async def ask(app: FastAPI, content: bytes) -> httpx.Response:
    headers = {"content-type": "application/json"}
    async with httpx.AsyncClient(
        transport=httpx.ASGITransport(app), base_url="http://gait.example"
    ) as client:
        return await client.post("/", content=content, headers=headers)


async def test_json_is_read_as_it_was_written() -> None:
    for content in (b'{"a": [1, 2.5, null, "\xc3\xa4"]}', b"[]", b'"x"', b"12"):
        strict, usual = await ask(STRICT, content), await ask(USUAL, content)
        assert strict.status_code == 200
        assert strict.json() == usual.json()


@pytest.mark.parametrize(
    "content",
    [
        b'{"a": 1, "a": 2}',
        b'{"a": NaN}',
        b'{"a": Infinity}',
        b'"\\ud800"',
        b"[" * 600 + b"]" * 600,
        b"{",
        b"\xff",
        b"",
    ],
)
async def test_what_another_reader_would_read_otherwise_is_refused(content: bytes) -> None:
    assert (await ask(STRICT, content)).status_code == 422


async def test_why_is_said() -> None:
    assert (await ask(USUAL, b'{"a": 1, "a": 2}')).status_code == 200
    assert "twice" in (await ask(STRICT, b'{"a": 1, "a": 2}')).text
