"""Guarantees of every blob store, checked for the folder and for a bucket behind real HTTP."""

from __future__ import annotations

import datetime as dt
import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from sagittal.server.storage import fs
from sagittal.server.storage.files.blob_bucket import BucketBlobs
from sagittal.server.storage.files.blob_folder import FolderBlobs
from sagittal.server.storage.files.blobs import INCOMING, BlobStore, IntegrityError
from sagittal.server.storage.files.s3_bucket import PUT_BYTES
from sagittal.server.storage.files.trash import KEPT
from tests.helpers.buckets import Bucket, bucket, s3_server  # noqa: F401 - fixtures

SPACE, OTHER = "a" * 32, "b" * 32
CONTENT = b"seven sensors"
NAME = hashlib.sha256(CONTENT).hexdigest()
AT = dt.datetime(2026, 3, 14, 3, 15, tzinfo=dt.UTC)


@dataclass
class Store:
    """Blob store, with unauthorised modification of its files."""

    blobs: BlobStore
    damage: Callable[[str, str, bytes], None]


@pytest.fixture(params=["folder", "bucket"])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Store:
    if request.param == "folder":
        folder = FolderBlobs(tmp_path / "blobs")
        return Store(folder, lambda space, name, content: _overwrite(folder.path(space, name), content))
    target: Bucket = request.getfixturevalue("bucket")
    blobs = BucketBlobs(target.url, tmp_path / "blobs" / INCOMING)
    return Store(blobs, lambda space, name, content: target.write(f"blobs/{space}/{name}", content))


def _overwrite(path: Path, content: bytes) -> None:
    path.write_bytes(content)


def addresses(blobs: BlobStore) -> list[tuple[str, str]]:
    return sorted((one.space, one.name) for one in blobs.files())


def code_of(call: Callable[[], object]) -> str:
    with pytest.raises(IntegrityError) as caught:
        call()
    return caught.value.code


@pytest.mark.slow
@pytest.mark.parametrize("content", [b"", CONTENT, os.urandom(PUT_BYTES + 12_345)], ids=["0", "13", "8M"])
def test_what_was_put_is_read_back_in_every_way(store: Store, content: bytes) -> None:
    blob = store.blobs.put(SPACE, content)
    assert (blob.sha256, blob.size) == (hashlib.sha256(content).hexdigest(), len(content))
    assert store.blobs.read(SPACE, blob.sha256) == content
    with store.blobs.open(SPACE, blob.sha256) as file:
        assert file.read() == content
        file.seek(5)
        assert file.read(4) == content[5:9]
    if content:
        assert store.blobs.read_part(SPACE, blob.sha256, 3, 9) == content[3:9]
    store.blobs.require(SPACE, blob.sha256)
    assert addresses(store.blobs) == [(SPACE, blob.sha256)]
    assert not any(store.blobs.incoming.iterdir())


def test_a_damaged_or_missing_file_is_never_given_and_another_put_mends_it(store: Store) -> None:
    blobs = store.blobs
    assert code_of(lambda: blobs.read(SPACE, NAME)) == "blob_missing"
    assert code_of(lambda: blobs.open(SPACE, NAME)) == "blob_missing"
    assert code_of(lambda: blobs.read_part(SPACE, NAME, 0, 3)) == "blob_missing"
    assert code_of(lambda: blobs.require(SPACE, NAME)) == "blob_missing"
    blobs.put(SPACE, CONTENT)
    for second in (b"", b"seven sensorz", CONTENT + b"!"):
        store.damage(SPACE, NAME, second)
        assert code_of(lambda: blobs.read(SPACE, NAME)) == "blob_damaged"
        assert code_of(lambda: blobs.open(SPACE, NAME)) == "blob_damaged"
    store.damage(SPACE, NAME, CONTENT[:5])
    assert code_of(lambda: blobs.read_part(SPACE, NAME, 3, 9)) == "blob_damaged"
    blobs.put(SPACE, CONTENT)
    assert blobs.read(SPACE, NAME) == CONTENT


def test_a_limit_is_kept_and_what_is_given_up_leaves_nothing(store: Store) -> None:
    with store.blobs.receive(SPACE, limit=10) as receiver:
        receiver.write(b"12345")
        assert [space for space, _ in addresses(store.blobs)] == [INCOMING]
        with pytest.raises(fs.SizeLimitError):
            receiver.write(b"678901")
    assert addresses(store.blobs) == []


def test_equal_bytes_of_two_spaces_are_two_files_and_one_space_is_erased_alone(store: Store) -> None:
    for space in (SPACE, OTHER):
        store.blobs.put(space, CONTENT)
    store.blobs.erase(SPACE)
    store.blobs.erase(SPACE)
    store.blobs.settle([SPACE])
    assert addresses(store.blobs) == [(OTHER, NAME)]
    store.blobs.remove(OTHER, NAME)
    store.blobs.remove(OTHER, NAME)
    assert addresses(store.blobs) == []


def test_an_upload_in_parts_is_adopted_and_a_bucket_leaves_it_where_it_waited(store: Store) -> None:
    part = store.blobs.part("c" * 32)
    fs.write_file(part, CONTENT)
    assert addresses(store.blobs) == [(INCOMING, part.name)]
    store.blobs.adopt(SPACE, part, NAME)
    assert store.blobs.read(SPACE, NAME) == CONTENT
    assert part.exists() == isinstance(store.blobs, BucketBlobs)


def test_an_address_cannot_leave_the_store(store: Store) -> None:
    for space, name in (("..", "0" * 64), (SPACE, "../../etc/passwd"), (SPACE.upper(), "0" * 64)):
        for call in (store.blobs.read, store.blobs.open, store.blobs.has, store.blobs.remove):
            with pytest.raises(ValueError, match="not the address"):
                call(space, name)
    with pytest.raises(ValueError, match="not the address"):
        store.blobs.erase("../other")


def test_a_file_is_old_until_somebody_writes_it_anew_and_then_gone(store: Store) -> None:
    store.blobs.put(SPACE, CONTENT)
    [result] = store.blobs.files()
    assert -2.0 < result.age_s < 60.0
    assert store.blobs.is_older(result, -60.0)
    assert not store.blobs.is_older(result, 60.0)
    store.blobs.discard([result])
    assert not store.blobs.is_older(result, -60.0)
    store.blobs.probe()
    assert addresses(store.blobs) == []


def test_the_trash_takes_keeps_gives_back_and_forgets(store: Store) -> None:
    blobs, trash = store.blobs, store.blobs.trash
    for content in (CONTENT, b"left where it is"):
        blobs.put(SPACE, content)
    left = next(one for one in addresses(blobs) if one != (SPACE, NAME))
    trash.prepare([(SPACE, NAME)], AT)
    trash.take([(SPACE, NAME)], AT)
    trash.settle([(SPACE, NAME)], AT)
    assert addresses(blobs) == [left]
    [one] = trash.files()
    assert (one.space, one.name, one.size, one.since) == (SPACE, NAME, len(CONTENT), AT)
    with trash.open(one) as file:
        assert file.read() == CONTENT
    trash.put_back(one)
    assert blobs.read(SPACE, NAME) == CONTENT
    assert list(trash.files()) == []

    def discard(content: bytes, space: str = SPACE, at: dt.datetime = AT) -> str:
        name = blobs.put(space, content).sha256
        trash.prepare([(space, name)], at)
        trash.take([(space, name)], at)
        trash.settle([(space, name)], at)
        return name

    young = discard(b"young", at=AT + dt.timedelta(days=1))
    discard(b"old")
    assert trash.expire(AT + KEPT) == 1
    assert [one.name for one in trash.files()] == [young]
    remaining = discard(b"of the other", OTHER)
    trash.remove(SPACE, [NAME])
    assert {one.name for one in trash.files()} == {young, remaining}
    trash.remove(SPACE)
    assert [one.name for one in trash.files()] == [remaining]
