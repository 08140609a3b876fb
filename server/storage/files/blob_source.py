"""Stored files as input of the readers of core."""

from __future__ import annotations

from sagittal.core.formats.source import SourceFile
from sagittal.server.storage.files.blobs import BlobStore


def open_source(store: BlobStore, space: str, name: str, size: int, sha256: str) -> SourceFile:
    """A blob as a source file, read and verified on demand."""
    return SourceFile(name, size, lambda: store.read(space, sha256), lambda: store.open(space, sha256))
