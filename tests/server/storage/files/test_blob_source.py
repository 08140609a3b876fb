"""A stored file as the readers of core take it."""

from __future__ import annotations

from pathlib import Path

import pytest

from sagittal.server.storage.files.blob_folder import FolderBlobs
from sagittal.server.storage.files.blob_source import open_source
from sagittal.server.storage.files.blobs import IntegrityError

SPACE = "a" * 32


def test_a_stored_file_has_the_name_that_it_was_uploaded_under(tmp_path: Path) -> None:
    blobs = FolderBlobs(tmp_path)
    blob = blobs.put(SPACE, b"seven sensors")
    source = open_source(blobs, SPACE, "walk.txt", blob.size, blob.sha256)
    assert (source.name, source.size) == ("walk.txt", 13)
    assert source.read() == b"seven sensors"
    with source.open() as file:
        assert file.read(5) == b"seven"


def test_it_is_read_only_when_somebody_needs_it_and_then_verified(tmp_path: Path) -> None:
    blobs = FolderBlobs(tmp_path)
    source = open_source(blobs, SPACE, "walk.txt", 13, "b" * 64)
    with pytest.raises(IntegrityError):
        source.read()
    blob = blobs.put(SPACE, b"seven sensors")
    blobs.path(SPACE, blob.sha256).write_bytes(b"seven sensorz")
    with pytest.raises(IntegrityError):
        open_source(blobs, SPACE, "walk.txt", blob.size, blob.sha256).read()
