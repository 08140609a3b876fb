"""From the folder into a bucket, while servers and workers are stopped; killed at any time, it is run again.

Every file is put, read back from the bucket by its hash, and only then removed here, the trash too. That the
move has begun is noted first: until it has ended no server starts and no command takes a file for missing.
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
    """What was moved.

    Parameters
    ----------
    files, trashed : how many stored files, and how many of the trash. size : bytes of the stored ones.
    damaged : what stays in the folder, since its bytes are not its own.
    """

    files: int
    trashed: int
    size: int
    damaged: tuple[str, ...]


def move_blobs(settings: Settings) -> MovedBlobs:
    """Move every stored file of the data folder into the bucket of the settings, whose prefix must be empty.

    Called again after it has ended, it moves what has come into the folder since.

    Raises
    ------
    SettingsError
        no bucket is set, the files are in another one already, or the bucket refuses or holds something.
    StoreAway
        it cannot be reached; what was moved is there, and the next call goes on.
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
