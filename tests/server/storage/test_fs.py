from __future__ import annotations

import errno
import subprocess
import sys
from pathlib import Path

import pytest

from sagittal.server.storage import fs
from sagittal.server.storage.files.blob_folder import FolderBlobs
from sagittal.server.storage.files.blobs import IntegrityError
from tests.data import ROOT
from tests.faults.failing import FailingSystem

SPACE = "a" * 32
CONTENT = b"seven sensors"


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO, errno.EMFILE])
def test_an_error_at_any_call_leaves_no_half_file_and_a_retry_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    fail_at = 0
    while True:
        fail_at += 1
        root = tmp_path / str(fail_at)
        store = FolderBlobs(root)
        system = FailingSystem(fail_at, number)
        monkeypatch.setattr(fs, "system", system)
        try:
            blob = store.put(SPACE, CONTENT)
        except OSError as error:
            assert error.errno == number  # noqa: PT017 - the last round does not raise
        else:
            assert system.calls == fail_at - 1  # every call has failed once
            break
        finally:
            monkeypatch.setattr(fs, "system", fs.System())
        for stored in store.files():
            assert stored.space == SPACE  # no temporary file is left
            assert store.find_path(stored).read_bytes() == CONTENT
        blob = store.put(SPACE, CONTENT)
        assert store.read(SPACE, blob.sha256) == CONTENT
    assert fail_at > 6


def test_every_flipped_bit_is_seen(tmp_path: Path) -> None:
    store = FolderBlobs(tmp_path)
    blob = store.put(SPACE, CONTENT)
    path = store.path(SPACE, blob.sha256)
    for bit in range(8 * len(CONTENT)):
        damaged = bytearray(CONTENT)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        with pytest.raises(IntegrityError) as caught:
            store.read(SPACE, blob.sha256)
        assert caught.value.code == "blob_damaged"
    path.unlink()
    with pytest.raises(IntegrityError) as caught:
        store.read(SPACE, blob.sha256)
    assert caught.value.code == "blob_missing"
    assert store.put(SPACE, CONTENT) == blob  # the same upload again repairs it
    assert store.read(SPACE, blob.sha256) == CONTENT


def test_a_limit_is_kept_while_receiving_and_nothing_is_left(tmp_path: Path) -> None:
    store = FolderBlobs(tmp_path)
    with store.receive(SPACE, limit=10) as receiver:
        receiver.write(b"12345")
        with pytest.raises(fs.SizeLimitError):
            receiver.write(b"678901")
    assert list(store.files()) == []


def test_equal_bytes_of_two_spaces_are_two_files(tmp_path: Path) -> None:
    store = FolderBlobs(tmp_path)
    second = "b" * 32
    assert store.put(SPACE, CONTENT) == store.put(second, CONTENT)
    store.erase(SPACE)
    assert [s.space for s in store.files()] == [second]


def test_an_address_cannot_leave_the_store(tmp_path: Path) -> None:
    store = FolderBlobs(tmp_path)
    for space, name in (("..", "0" * 64), (SPACE, "../../etc/passwd"), (SPACE.upper(), "0" * 64)):
        with pytest.raises(ValueError, match="not the address"):
            store.path(space, name)


def test_files_are_for_their_owner_only(tmp_path: Path) -> None:
    store = FolderBlobs(tmp_path / "blobs")
    blob = store.put(SPACE, CONTENT)
    path = store.path(SPACE, blob.sha256)
    assert path.stat().st_mode & 0o777 == 0o600
    assert path.parent.stat().st_mode & 0o777 == 0o700


def test_one_lock_at_a_time_and_it_dies_with_its_holder(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    script = f"""
import pathlib, sys
from sagittal.server.storage import fs
lock = fs.Lock(pathlib.Path({str(path)!r}), "process one")
print("locked", flush=True)
sys.stdin.read()
"""
    holder = subprocess.Popen(
        [sys.executable, "-c", script], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert holder.stdout is not None
    assert holder.stdin is not None
    assert holder.stdout.readline() == "locked\n"
    with pytest.raises(fs.LockedError) as caught:
        fs.Lock(path, "process two")
    assert caught.value.holder == "process one"
    holder.kill()
    holder.wait()
    holder.stdout.close()
    holder.stdin.close()
    fs.Lock(path, "process two").release()
    fs.Lock(path, "process three").release()
