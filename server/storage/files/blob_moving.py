"""Moves stored files from the folder to a bucket, while servers and workers are stopped; resumable.

Every file, including the trash, is uploaded, read back, verified by hash, and only then removed locally. The
start of the move is recorded first: until it is complete, no server starts and no command mistakes files for
missing.
"""

from __future__ import annotations

from dataclasses import dataclass

from sagittal.server.settings import Settings, SettingsError
from sagittal.server.storage import fs
from sagittal.server.storage.files.blob_bucket import BucketBlobs
from sagittal.server.storage.files.blob_folder import FolderBlobs
from sagittal.server.storage.files.blob_opening import explain_refusal, is_moving, read_note, write_note
from sagittal.server.storage.files.blobs import INCOMING, IntegrityError, StoreAway


@dataclass(frozen=True)
class MovedBlobs:
    """Summary of a move.

    Parameters
    ----------
    files, trashed : numbers of stored and trashed files. size : bytes of the stored ones.
    damaged : files with a wrong hash, which remain in the folder.
    """

    files: int
    trashed: int
    size: int
    damaged: tuple[str, ...]


def move_blobs(settings: Settings) -> MovedBlobs:
    """Move all stored files of the data folder to the configured bucket, whose prefix must be empty.

    Called again after completion, it moves files added to the folder since.

    Raises
    ------
    SettingsError
        no bucket is set, the files are in another one, or the bucket denies access or is not empty.
    StoreAway
        it cannot be reached; the next call resumes.
    """
    if not settings.bucket:
        raise SettingsError("Set SAGITTAL_BUCKET to where the stored files are to be, s3://name/prefix.")
    folder = FolderBlobs(settings.blobs)
    bucket = BucketBlobs(settings.bucket, folder.incoming)
    if not is_moving(settings) and (noted := read_note(settings)) != settings.bucket:
        if noted:
            raise SettingsError(f"The stored files of {settings.data_dir} are to be in {noted} already.")
        _require_empty(bucket)
        write_note(settings, moving=True)
    moved, size, damaged = 0, 0, []
    for one in folder.files():
        if one.space == INCOMING:
            continue
        path = folder.find_path(one)
        try:
            folder.open(one.space, one.name).close()
        except (IntegrityError, ValueError):
            damaged.append(f"{one.space}/{one.name}")
            continue
        moved, size = moved + 1, size + path.stat().st_size
        bucket.adopt(one.space, path, one.name)
        bucket.open(one.space, one.name).close()
        fs.remove_file(path)
    trashed = _move_trash(folder, bucket)
    for path in folder.root.iterdir():
        if path.name != INCOMING and path.is_dir() and not any(path.iterdir()):
            fs.remove_folder(path)
    write_note(settings)
    return MovedBlobs(moved, trashed, size, tuple(damaged))


def _require_empty(bucket: BucketBlobs) -> None:
    try:
        if not bucket.is_empty():
            raise SettingsError(
                f"{bucket.place} is not empty. Give a prefix in which nothing is; one prefix is for one "
                "clinic."
            )
        bucket.probe()
    except StoreAway as error:
        if error.refuses:
            raise SettingsError(explain_refusal(bucket, error)) from None
        raise


def _move_trash(folder: FolderBlobs, bucket: BucketBlobs) -> int:
    old, new = folder.trash, bucket.trash
    waiting = list(old.files())
    for one in waiting:
        new.receive(one, old.path(one))
        fs.remove_file(old.path(one))
    if waiting:
        old.tidy()
    return len(waiting)
