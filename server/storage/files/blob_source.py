"""A stored file as the readers of core take their input."""

from __future__ import annotations

from sagittal.core.formats.source import SourceFile
from sagittal.server.storage.files.blobs import BlobStore


def open_source(store: BlobStore, space: str, name: str, size: int, sha256: str) -> SourceFile:
    """A blob under its own name, read and verified when somebody needs it."""
    return SourceFile(name, size, lambda: store.read(space, sha256), lambda: store.open(space, sha256))
