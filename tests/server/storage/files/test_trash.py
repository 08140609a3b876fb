"""Manual changes to the trash do not stop the server, and nothing outside is touched."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from sagittal.server.storage.files.trash import FolderTrash

SPACE, NAME, OTHER = "a" * 32, "b" * 64, "c" * 64


@pytest.fixture
def stamp(tmp_path: Path) -> Path:
    folder = tmp_path / "trash" / "20260314T031500Z"
    (folder / SPACE).mkdir(parents=True)
    (folder / SPACE / NAME).write_bytes(b"ours")
    return folder


def a_broken_link(stamp: Path) -> None:
    (stamp / SPACE / OTHER).symlink_to("/nonexistent")


def a_file_in_place_of_a_folder(stamp: Path) -> None:
    (stamp / ("d" * 32)).write_bytes(b"?")


def a_link_to_a_folder(stamp: Path) -> None:
    outside = stamp.parent.parent / "outside" / ("d" * 32)
    outside.mkdir(parents=True)
    (outside / OTHER).write_bytes(b"theirs")
    (stamp / ("d" * 32)).symlink_to(outside)
    (stamp.parent / "20260315T000000Z").symlink_to(outside.parent)


@pytest.mark.parametrize("put", [a_broken_link, a_file_in_place_of_a_folder, a_link_to_a_folder])
def test_what_is_not_ours_is_passed_over(stamp: Path, put: Callable[[Path], None]) -> None:
    put(stamp)
    trash = FolderTrash(stamp.parent, stamp.parent.parent / "blobs")
    assert [one.name for one in trash.files()] == [NAME]
    trash.remove("d" * 32)
    trash.remove("d" * 32, [OTHER])
    trash.tidy()
    assert all(p.exists() for p in stamp.parent.parent.glob(f"outside/*/{OTHER}"))
    assert len(list(stamp.parent.parent.glob(f"outside/*/{OTHER}"))) == (put is a_link_to_a_folder)
    trash.remove(SPACE, [NAME])
    assert list(trash.files()) == []


def test_a_folder_that_is_removed_while_it_is_listed_is_passed_over(stamp: Path) -> None:
    (stamp / SPACE / OTHER).write_bytes(b"ours")
    files = FolderTrash(stamp.parent, stamp.parent.parent / "blobs").files()
    assert next(files).name == NAME
    for path in (stamp / SPACE).iterdir():
        path.unlink()
    (stamp / SPACE).rmdir()
    assert list(files) == []
