"""No body but that of a file is read without bound."""

from __future__ import annotations

from collections.abc import AsyncIterator

import httpx
import pytest
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.types import Receive, Scope, Send

from sagittal.server.http.body_limit import MAX_BODY_BYTES, BodyLimit
from sagittal.server.http.problems import Problem, problem_response

pytestmark = pytest.mark.anyio
SESSION = "/api/v1/sessions/1"


async def _measure(scope: Scope, receive: Receive, send: Send) -> None:
    """Answer with the length of the body, as the application does with its refusals."""
    request = Request(scope, receive)
    try:
        answer = PlainTextResponse(str(len(await request.body())))
    except Problem as problem:
        answer = problem_response(problem, request)  # type: ignore[assignment]
    await answer(scope, receive, send)


async def ask(
    size: int, method: str = "POST", path: str = "/api/v1/patients", *, declared: bool
) -> httpx.Response:
    async def pieces() -> AsyncIterator[bytes]:
        for position in range(0, size, 1 << 16):
            yield b"x" * min(1 << 16, size - position)

    async with httpx.AsyncClient(transport=httpx.ASGITransport(BodyLimit(_measure))) as client:
        content = b"x" * size if declared else pieces()
        return await client.request(method, f"http://gait.example{path}", content=content)


@pytest.mark.parametrize("declared", [True, False])
async def test_a_body_ends_at_the_limit_said_or_not(declared: bool) -> None:
    whole = await ask(MAX_BODY_BYTES, declared=declared)
    assert (whole.status_code, whole.text) == (200, str(MAX_BODY_BYTES))
    more = await ask(MAX_BODY_BYTES + 1, declared=declared)
    assert (more.status_code, more.json()["code"]) == (413, "too_large")
    assert str(MAX_BODY_BYTES) in more.json()["detail"]


@pytest.mark.parametrize(
    ("method", "path", "free"),
    [
        ("PUT", f"{SESSION}/files/walk.txt", True),
        ("POST", f"{SESSION}/files", True),
        ("PUT", f"{SESSION}/references/a.sto", True),
        ("PUT", f"{SESSION}/video", True),
        ("PATCH", f"{SESSION}/uploads/2", True),
        ("PUT", f"{SESSION}/manifest", False),
        ("PUT", f"{SESSION}/filesystem", False),
        ("POST", f"{SESSION}/uploads/2", False),
        ("PUT", "/api/v1/sessions/1/2/files/a", False),
        ("PUT", "/elsewhere" + SESSION + "/files/a", False),
    ],
)
async def test_files_have_a_limit_of_their_own(method: str, path: str, free: bool) -> None:
    answer = await ask(MAX_BODY_BYTES + 1, method, path, declared=True)
    assert answer.status_code == (200 if free else 413)


@pytest.mark.parametrize("said", ["-1", "1e3", "0x10", "many"])
async def test_a_length_that_is_no_number_is_refused(said: str) -> None:
    async with httpx.AsyncClient(transport=httpx.ASGITransport(BodyLimit(_measure))) as client:
        answer = await client.post("http://gait.example/", headers={"Content-Length": said})
    assert answer.status_code == 413
