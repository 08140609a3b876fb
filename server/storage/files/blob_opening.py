"""Opens the configured blob store, either kind.

The data folder records the bucket of its files, so that a command with a missing or wrong setting is refused
instead of finding all files missing. It is recorded once that bucket has granted access to a server or stored
a file, so that a mistyped name has no effect.
"""

from __future__ import annotations

import logging
from functools import partial
from typing import Final

from sagittal.server.settings import Settings, SettingsError
from sagittal.server.storage import fs
from sagittal.server.storage.files.blob_bucket import BucketBlobs
from sagittal.server.storage.files.blob_folder import FolderBlobs
from sagittal.server.storage.files.blobs import INCOMING, BlobStore, StoreAway, is_space

log = logging.getLogger(__name__)

_NOTE: Final = "bucket.txt"
_MOVING: Final = "moving to "


def open_blobs(settings: Settings) -> BlobStore:
    """Stored files of this installation.

    Raises
    ------
    SettingsError
        the files are in the folder or in a bucket other than configured.
    """
    noted = read_note(settings)
    if noted.startswith(_MOVING):
        raise SettingsError(
            f"A move of stored files to {noted.removeprefix(_MOVING)} was interrupted. Run `sagittal "
            "move-blobs` again."
        )
    if noted != settings.bucket and noted:
        raise SettingsError(_explain_other(settings, noted))
    if not settings.bucket:
        return FolderBlobs(settings.blobs)
    if not noted and has_stored_files(settings):
        raise SettingsError(
            f"The stored files are in {settings.blobs}, but bucket is '{settings.bucket}'. Run `sagittal "
            "move-blobs` first, while servers and workers are stopped."
        )
    return BucketBlobs(settings.bucket, settings.blobs / INCOMING, partial(note_bucket, settings))


def require_use(blobs: BlobStore) -> bool:
    """Check access to the store before startup; if it is unavailable, log a warning.

    Returns
    -------
    Whether access was granted; False = unavailable.

    Raises
    ------
    SettingsError
        access denied: no such bucket, wrong keys or region.
    """
    if not isinstance(blobs, BucketBlobs):
        return True
    try:
        blobs.probe()
        if blobs.keeps_versions():
            log.warning(
                "%s keeps versions: who is erased stays in them until a rule of the bucket removes old ones",
                blobs.place,
            )
    except StoreAway as error:
        if error.refuses:
            raise SettingsError(f"{explain_refusal(blobs, error)}") from None
        log.warning("%s cannot be reached; until it can, what needs stored files waits", blobs.place)
        return False
    return True


def explain_refusal(blobs: BlobStore, error: StoreAway) -> str:
    """Message for the administrator."""
    return (
        f"{blobs.place} cannot be used ({error.detail}). Check SAGITTAL_BUCKET, AWS_ENDPOINT_URL, AWS_REGION "
        "and the keys."
    )


def has_stored_files(settings: Settings) -> bool:
    """Whether the data folder itself contains stored files."""
    folder = settings.blobs
    return folder.is_dir() and any(is_space(path.name) and any(path.iterdir()) for path in folder.iterdir())


def read_note(settings: Settings) -> str:
    """The bucket recorded for this data folder, "" = none."""
    try:
        return (settings.blobs / _NOTE).read_text("utf-8").strip()
    except FileNotFoundError:
        return ""


def note_bucket(settings: Settings) -> None:
    """Record the configured bucket, if there is one and none is recorded.

    Raises
    ------
    SettingsError
        another one is recorded.
    """
    noted = read_note(settings)
    if settings.bucket and not noted:
        write_note(settings)
    elif noted != settings.bucket:
        raise SettingsError(_explain_other(settings, noted))


def warn_of_leftovers(settings: Settings) -> None:
    """Log a warning if files remain in the data folder, where they are not found any more."""
    if settings.bucket and has_stored_files(settings):
        log.warning(
            "stored files are in %s too; stop servers and workers and run `sagittal move-blobs` again",
            settings.blobs,
        )


def _explain_other(settings: Settings, noted: str) -> str:
    return (
        f"The stored files of {settings.data_dir} are in {noted}, but bucket is '{settings.bucket}'. Set "
        f"SAGITTAL_BUCKET={noted}."
    )


def is_moving(settings: Settings) -> bool:
    """Whether a move to the configured bucket has started and is incomplete."""
    return read_note(settings) == _MOVING + settings.bucket


def write_note(settings: Settings, *, moving: bool = False) -> None:
    """Durably record the bucket of the files."""
    fs.make_folder(settings.blobs)
    text = f"{_MOVING if moving else ''}{settings.bucket}\n"
    fs.write_file(settings.blobs / _NOTE, text.encode())
