"""Several files in one zip, the same bytes for the same files."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from typing import Any, Final

EARLIEST: Final = (1980, 1, 1, 0, 0, 0)
"""Time of every member, the earliest that a zip knows, so that the same content gives the same bytes."""


def zip_files(files: Mapping[str, bytes]) -> bytes:
    """Pack files, path → bytes."""
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, content in files.items():
            archive.writestr(zipfile.ZipInfo(path, EARLIEST), content, zipfile.ZIP_DEFLATED)
    return target.getvalue()


class ZipSink(io.RawIOBase):
    """What a zip is written into: it cannot go back, and hands on what came."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []

    def writable(self) -> bool:
        """Yes."""
        return True

    def write(self, data: Any) -> int:
        """Keep some bytes."""
        self._pieces.append(bytes(data))
        return len(data)

    def take(self) -> bytes:
        """What has come since it was last asked."""
        taken = b"".join(self._pieces)
        self._pieces.clear()
        return taken
