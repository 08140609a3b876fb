"""A named piece of input whose bytes are read only when somebody needs them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, eq=False)
class SourceFile:
    """One input file: a blob, a file on disk or a member of an archive.

    Parameters
    ----------
    name : path as the sender gave it, with forward slashes; any Unicode.
    size : bytes (for an archive member the size its directory declares).
    read : returns all bytes; may raise `core.errors.ArchiveError`.
    """

    name: str
    size: int
    read: Callable[[], bytes]

    @classmethod
    def of_bytes(cls, name: str, data: bytes) -> SourceFile:
        """Wrap bytes that are already in memory."""
        return cls(name, len(data), lambda: data)

    @classmethod
    def of_path(cls, path: Path, name: str | None = None) -> SourceFile:
        """Wrap a file on disk; `name` defaults to its last part."""
        return cls(name or path.name, path.stat().st_size, path.read_bytes)


def sha256(data: bytes) -> str:
    """Hexadecimal sha256 of bytes."""
    return hashlib.sha256(data).hexdigest()
