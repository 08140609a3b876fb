"""A named piece of input whose bytes are read only when somebody needs them."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

from sagittal.core.errors import InputError

_PIECE: Final = 1 << 20


@dataclass(frozen=True, eq=False)
class SourceFile:
    """One input file: a blob, a file on disk or a member of an archive.

    Parameters
    ----------
    name : path as the sender gave it, with forward slashes; any Unicode.
    size : bytes (for an archive member the size its directory declares).
    read : returns all bytes; may raise `sagittal.core.errors.ArchiveError`.
    opener : opens the bytes to be read piece by piece; None = they can only be had at once.
    """

    name: str
    size: int
    read: Callable[[], bytes]
    opener: Callable[[], BinaryIO] | None = None

    def open(self) -> BinaryIO:
        """The bytes from the start, to be closed by who asked."""
        return io.BytesIO(self.read()) if self.opener is None else self.opener()

    @classmethod
    def of_bytes(cls, name: str, data: bytes) -> SourceFile:
        """Wrap bytes that are already in memory."""
        return cls(name, len(data), lambda: data)

    @classmethod
    def of_path(cls, path: Path, name: str | None = None) -> SourceFile:
        """Wrap a file on disk; `name` defaults to its last part."""
        return cls(name or path.name, path.stat().st_size, path.read_bytes, lambda: path.open("rb"))


def list_source_files(paths: Iterable[Path]) -> Iterator[SourceFile]:
    """Files that a person named, folders walked, as lazily read sources.

    Raises
    ------
    InputError `file_not_found`.
    """
    for path in paths:
        if not path.exists():
            raise InputError("file_not_found", f"{path} does not exist; give files, a folder or a zip.")
        for file in sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]:
            yield SourceFile.of_path(file, str(file.relative_to(path)) if path.is_dir() else file.name)


def read_named_file(path: Path) -> bytes:
    """Bytes of a file that a person named; raises InputError `file_not_found`."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError("file_not_found", f"{path} cannot be read: {error.strerror or error}.") from error


def stem_of(name: str) -> str:
    """Last part of a file's name without its ending."""
    return name.replace("\\", "/").rsplit("/", 1)[-1].rsplit(".", 1)[0]


def digest_file(file: SourceFile) -> str:
    """Hexadecimal sha256 of a file, read piece by piece."""
    digest = hashlib.sha256()
    with file.open() as opened:
        while piece := opened.read(_PIECE):
            digest.update(piece)
    return digest.hexdigest()


def sha256(data: bytes) -> str:
    """Hexadecimal sha256 of bytes."""
    return hashlib.sha256(data).hexdigest()
