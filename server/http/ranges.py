"""Range requests for long content, such as those of video players (RFC 9110 §14)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Final

from starlette.responses import Response, StreamingResponse

PIECE: Final = 1 << 20
"""Bytes read at a time."""
_RANGE: Final = re.compile(r"bytes=(\d{0,18})-(\d{0,18})")


def answer_range(
    headers: Mapping[str, str],
    size: int,
    version: str,
    read: Callable[[int, int], bytes],
    media_type: str,
) -> Response:
    """Respond with the requested range, or the whole content if none or several are requested.

    Parameters
    ----------
    headers : of the request, names in lower case. size : total bytes.
    version : entity tag; a range of another version returns the whole content.
    read : returns the bytes from start to stop.
    """
    tag = f'"{version}"'
    ours = {"Accept-Ranges": "bytes", "ETag": tag}
    match = _RANGE.fullmatch(headers.get("range", "").replace(" ", ""))
    if match is None or match.group(1, 2) == ("", "") or headers.get("if-range", tag) != tag:
        return _stream(read, 0, size, media_type, 200, ours)
    first, last = match.groups()
    start = max(size - int(last), 0) if not first else int(first)
    stop = min(int(last) + 1, size) if first and last else size
    if first and last and int(last) < int(first):
        return _stream(read, 0, size, media_type, 200, ours)  # no range at all
    if start >= size:
        return Response(status_code=416, headers={**ours, "Content-Range": f"bytes */{size}"})
    response_headers = {**ours, "Content-Range": f"bytes {start}-{stop - 1}/{size}"}
    return _stream(read, start, stop, media_type, 206, response_headers)


def _stream(
    read: Callable[[int, int], bytes],
    start: int,
    stop: int,
    media_type: str,
    status: int,
    headers: Mapping[str, str],
) -> StreamingResponse:
    # the first part is read here, so that a file error gives an error response rather than a broken
    # connection
    first = read(start, min(start + PIECE, stop)) if stop > start else b""

    def rest() -> Iterator[bytes]:
        yield first
        for position in range(start + PIECE, stop, PIECE):
            yield read(position, min(position + PIECE, stop))

    length = {"Content-Length": str(stop - start)}
    return StreamingResponse(rest(), status, {**headers, **length}, media_type)
