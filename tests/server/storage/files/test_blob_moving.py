"""Stored files on their way from the folder into a bucket."""

from __future__ import annotations

import datetime as dt
from dataclasses import replace
from pathlib import Path

import pytest

from sagittal.server.settings import Settings, SettingsError
from sagittal.server.storage.files.blob_folder import FolderBlobs
from sagittal.server.storage.files.blob_moving import move_blobs
from sagittal.server.storage.files.blob_opening import is_moving, open_blobs, read_note, write_note
from sagittal.server.storage.files.blobs import INCOMING
from tests.helpers.buckets import Bucket, bucket, s3_server  # noqa: F401 - fixtures

SPACE = "a" * 32
AT = dt.datetime(2026, 3, 14, 3, 15, tzinfo=dt.UTC)


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(data_dir=tmp_path)


def test_without_a_bucket_or_with_another_one_nothing_is_moved(settings: Settings) -> None:
    blob = FolderBlobs(settings.blobs).put(SPACE, b"walk")
    with pytest.raises(SettingsError, match="Set SAGITTAL_BUCKET"):
        move_blobs(settings)
    pytest.importorskip("obstore", reason="the extra s3 is not installed: pip install '.[s3]'")
    write_note(replace(settings, bucket="s3://first/clinic"))
    with pytest.raises(SettingsError, match="are to be in s3://first/clinic already"):
        move_blobs(replace(settings, bucket="s3://second/clinic"))
    assert FolderBlobs(settings.blobs).has(SPACE, blob.sha256)


def test_files_and_trash_go_and_what_is_damaged_or_still_coming_stays(
    settings: Settings,
    bucket: Bucket,  # noqa: F811
) -> None:
    folder = FolderBlobs(settings.blobs)
    whole, bad, old = (folder.put(SPACE, content) for content in (b"walk", b"bad", b"old"))
    other_response = folder.put("b" * 32, b"another patient's")
    folder.path(SPACE, bad.sha256).write_bytes(b"bat")
    folder.trash.prepare([(SPACE, old.sha256)], AT)
    folder.trash.take([(SPACE, old.sha256)], AT)
    (folder.root / INCOMING).mkdir(exist_ok=True)
    (folder.root / INCOMING / "half").write_bytes(b"ha")
    target = replace(settings, bucket=bucket.url)

    moved = move_blobs(target)
    assert (moved.files, moved.size, moved.trashed) == (2, whole.size + other_response.size, 1)
    assert moved.damaged == (f"{SPACE}/{bad.sha256}",)
    assert folder.path(SPACE, bad.sha256).read_bytes() == b"bat"
    assert (folder.root / INCOMING / "half").exists()
    assert not (folder.root / ("b" * 32)).exists()
    assert list(folder.trash.files()) == []

    blobs = open_blobs(target)
    assert blobs.read(SPACE, whole.sha256) == b"walk"
    assert [one.name for one in blobs.trash.files()] == [old.sha256]
    assert (is_moving(target), read_note(target)) == (False, bucket.url)
    second = move_blobs(target)  # what has come into the folder since
    assert (second.files, second.trashed, second.damaged) == (0, 0, moved.damaged)


def test_a_prefix_in_which_something_is_belongs_to_somebody_else(
    settings: Settings,
    bucket: Bucket,  # noqa: F811
) -> None:
    blob = FolderBlobs(settings.blobs).put(SPACE, b"walk")
    bucket.write("another's", b"file")
    target = replace(settings, bucket=bucket.url)
    with pytest.raises(SettingsError, match="is not empty"):
        move_blobs(target)
    assert FolderBlobs(settings.blobs).has(SPACE, blob.sha256)
    assert not is_moving(target)
