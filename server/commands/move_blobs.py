"""`sagittal move-blobs`: move stored files from the data folder into a bucket."""

from __future__ import annotations

import sys

from sagittal.server.commands.options import DataDir
from sagittal.server.settings import load_settings


def move_blobs(*, data_dir: DataDir = None) -> int:
    """Move stored files into SAGITTAL_BUCKET; 1 if not possible, or if damaged files remain."""
    from sagittal.server.storage import fs
    from sagittal.server.storage.files import blob_moving

    settings = load_settings({"data_dir": data_dir})
    if not settings.blobs.is_dir():
        sys.stderr.write(f"There are no stored files in {settings.data_dir}; give the folder with --data.\n")
        return 1
    holder = "a move of stored files"
    try:
        with fs.Lock(settings.lock, holder), fs.Lock(settings.workers_lock, holder):
            moved = blob_moving.move_blobs(settings)
    except fs.LockedError as error:
        sys.stderr.write(f"{settings.data_dir} is in use by {error.holder}; stop it first.\n")
        return 1
    sys.stdout.write(
        f"{moved.files} stored files ({moved.size} bytes) and {moved.trashed} of the trash are in "
        f"{settings.bucket} now; each was read back.\n"
    )
    sys.stdout.flush()
    for one in moved.damaged:
        sys.stderr.write(f"{settings.blobs / one} is damaged and was left there; see `sagittal check`.\n")
    return 1 if moved.damaged else 0
