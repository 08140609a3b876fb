"""A part of something long, as a player asks for it."""

from __future__ import annotations

import pytest
from starlette.responses import Response, StreamingResponse

from sagittal.server.http import ranges
from sagittal.server.http.ranges import answer_range

pytestmark = pytest.mark.anyio
CONTENT = bytes(range(256)) * 10
SIZE = len(CONTENT)


def ask(content: bytes = CONTENT, **headers: str) -> Response:
    message = {name.replace("_", "-"): value for name, value in headers.items()}
    return answer_range(message, len(content), "v1", lambda a, b: content[a:b], "video/mp4")


async def body_of(answer: Response) -> bytes:
    if not isinstance(answer, StreamingResponse):
        return bytes(answer.body)
    return b"".join([bytes(piece) async for piece in answer.body_iterator])  # type: ignore[arg-type]


@pytest.mark.parametrize("piece", [7, 256, 1 << 20])
@pytest.mark.parametrize(
    ("asked", "start", "stop"),
    [
        ("bytes=0-0", 0, 1),
        ("bytes=0-255", 0, 256),
        ("bytes=100-", 100, SIZE),
        ("bytes=-10", SIZE - 10, SIZE),
        ("bytes=-999999", 0, SIZE),
        ("bytes=2000-999999", 2000, SIZE),
        ("bytes= 5 - 9", 5, 10),
    ],
)
async def test_one_range_is_given(
    monkeypatch: pytest.MonkeyPatch, piece: int, asked: str, start: int, stop: int
) -> None:
    monkeypatch.setattr(ranges, "PIECE", piece)
    answer = ask(range=asked)
    assert answer.status_code == 206
    assert await body_of(answer) == CONTENT[start:stop]
    assert answer.headers["content-range"] == f"bytes {start}-{stop - 1}/{SIZE}"
    assert answer.headers["content-length"] == str(stop - start)


@pytest.mark.parametrize(
    "asked", ["", "bytes=", "bytes=-", "bytes=9-5", "bytes=0-1,5-6", "lines=1-2", "bytes=x-"]
)
async def test_anything_else_gets_all(asked: str) -> None:
    answer = ask(range=asked)
    assert (answer.status_code, answer.headers["accept-ranges"]) == (200, "bytes")
    assert await body_of(answer) == CONTENT


@pytest.mark.parametrize("asked", [f"bytes={SIZE}-", "bytes=999999-1000000", "bytes=-0"])
def test_a_range_behind_the_end_is_refused(asked: str) -> None:
    answer = ask(range=asked)
    assert (answer.status_code, answer.headers["content-range"]) == (416, f"bytes */{SIZE}")


async def test_a_range_of_another_version_gets_all() -> None:
    assert ask(range="bytes=0-1", if_range='"v1"').status_code == 206
    assert ask(range="bytes=0-1", if_range='"v0"').status_code == 200
    assert await body_of(ask(b"")) == b""
