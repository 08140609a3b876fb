"""Responses that a browser saves as a file."""

from __future__ import annotations

from typing import Any
from urllib.parse import quote

from starlette.responses import Response

BINARY = {"type": "string", "format": "binary"}
"""Schema of a binary body."""
ANY_FILE: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "The file",
        "content": {"application/json": {"schema": {}}, "*/*": {"schema": BINARY}},
    }
}
"""`responses` of an operation that sends files of several types, JSON among them."""

TYPES = {
    ".json": "application/json",
    ".csv": "text/csv; charset=utf-8",
    ".parquet": "application/vnd.apache.parquet",
    ".xlsx": "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet",
    ".zip": "application/zip",
}


def attachment(content: bytes, name: str, media_type: str | None = None) -> Response:
    """Return a file download; its name may contain any Unicode characters (RFC 6266, RFC 8187)."""
    if media_type is None:
        media_type = TYPES.get(name[name.rfind(".") :], "application/octet-stream")
    return Response(content, media_type=media_type, headers={"Content-Disposition": write_disposition(name)})


def write_disposition(name: str) -> str:
    """Content-Disposition header of a file download with this name."""
    plain = "".join(ch if ch.isascii() and ch.isprintable() and ch not in '"\\%' else "_" for ch in name)
    return f"attachment; filename=\"{plain}\"; filename*=UTF-8''{quote(name, safe='')}"
