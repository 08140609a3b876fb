"""Named input whose bytes are read on demand."""

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
    name : path as given by the sender, with forward slashes; any Unicode.
    size : bytes (for an archive member the size its directory declares).
    read : returns all bytes; may raise `sagittal.core.errors.ArchiveError`.
    opener : opens a stream of the bytes; None = only available as a whole.
    """

    name: str
    size: int
    read: Callable[[], bytes]
    opener: Callable[[], BinaryIO] | None = None

    def open(self) -> BinaryIO:
        """A stream from the start, to be closed by the caller."""
        return io.BytesIO(self.read()) if self.opener is None else self.opener()

    @classmethod
    def of_bytes(cls, name: str, data: bytes) -> SourceFile:
        """Wrap bytes that are already in memory."""
        return cls(name, len(data), lambda: data)

    @classmethod
    def of_path(cls, path: Path, name: str | None = None) -> SourceFile:
        """Wrap a file on disk; `name` defaults to the last part of its path."""
        return cls(name or path.name, path.stat().st_size, path.read_bytes, lambda: path.open("rb"))


def list_source_files(paths: Iterable[Path]) -> Iterator[SourceFile]:
    """The given files, with folders expanded recursively, as lazily read sources.

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
    """Bytes of a user-specified file; raises InputError `file_not_found`."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError("file_not_found", f"{path} cannot be read: {error.strerror or error}.") from error


def stem_of(name: str) -> str:
    """Last part of a file's path without its extension."""
    return name.replace("\\", "/").rsplit("/", 1)[-1].rsplit(".", 1)[0]


def digest_file(file: SourceFile) -> str:
    """Hexadecimal SHA-256 of a file, read in chunks."""
    digest = hashlib.sha256()
    with file.open() as opened:
        while piece := opened.read(_PIECE):
            digest.update(piece)
    return digest.hexdigest()


def sha256(data: bytes) -> str:
    """Hexadecimal SHA-256 of bytes."""
    return hashlib.sha256(data).hexdigest()
