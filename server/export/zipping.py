"""Reproducible zips: the same files give the same bytes."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from typing import Any, Final

EARLIEST: Final = (1980, 1, 1, 0, 0, 0)
"""Timestamp of every member, the earliest allowed in a zip, so that the same content gives the same bytes."""


def zip_files(files: Mapping[str, bytes]) -> bytes:
    """Pack files, path → bytes."""
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, content in files.items():
            archive.writestr(zipfile.ZipInfo(path, EARLIEST), content, zipfile.ZIP_DEFLATED)
    return target.getvalue()


class ZipSink(io.RawIOBase):
    """Unseekable output of a zip whose content can be taken while it is written."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []

    def writable(self) -> bool:
        """Return True."""
        return True

    def write(self, data: Any) -> int:
        """Append bytes."""
        self._pieces.append(bytes(data))
        return len(data)

    def take(self) -> bytes:
        """Return the bytes written since the last call."""
        content = b"".join(self._pieces)
        self._pieces.clear()
        return content
