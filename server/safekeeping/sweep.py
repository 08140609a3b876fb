"""Deletion of unreferenced stored files: interrupted uploads, results of lost claims, replaced files.

They remain in the trash for 30 days, because a database restored from a backup refers to fewer files; after a
restore nothing is deleted until confirmed (services/custody.py). Only partially received files and erased
data are removed immediately.

A recent file may be about to be referenced, so only files older than a grace period are removed, under the
write lock: a publisher has either committed (the reference is visible) or will find its file missing in its
own transaction (BlobStore.require) and fail cleanly.
"""

from __future__ import annotations

import logging

from sqlalchemy import Connection

from sagittal.server.live_takes import films
from sagittal.server.safekeeping import custody, erasure
from sagittal.server.settings import Settings
from sagittal.server.storage import fs
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blobs import INCOMING, BlobStore
from sagittal.server.storage.references import list_referenced
from sagittal.server.storage.schema.tables import now
from sagittal.server.uploads import uploads

log = logging.getLogger(__name__)


def sweep(db: Database, blobs: BlobStore, settings: Settings) -> int:
    """Move unreferenced files older than `settings.sweep_grace_s` to the trash and delete expired ones.

    Returns
    -------
    Number of files moved; 0 if this database is in doubt, or another sweep is in progress.
    """
    try:
        with blobs.lock_sweep():
            return _sweep(db, blobs, settings)
    except fs.LockedError:
        return 0


def _sweep(db: Database, blobs: BlobStore, settings: Settings) -> int:
    erasure.finish(db, blobs, settings)
    old = [f for f in blobs.files() if f.age_s >= settings.sweep_grace_s]
    with db.read() as c:
        doubted = custody.find_doubt(c, settings)
        erased = erasure.list_erased_spaces(c)
    if doubted is not None:
        log.warning("no stored file is taken away: %s See `sagittal check`.", doubted)
        return 0
    films.settle_abandoned(db, blobs, settings)
    uploads.drop_abandoned(db, blobs)
    with db.read() as c:
        used = _list_used(c)
    trash, time, count, step = blobs.trash, now(), 0, blobs.moved_at_once
    idle = [f for f in old if (f.space, f.name) not in used]
    for group in (idle[i : i + step] for i in range(0, len(idle), step)):
        going = [(f.space, f.name) for f in group if f.space != INCOMING and f.space not in erased]
        removable, gone = [], []
        trash.prepare(going, time)
        with db.write() as c:
            # again: data may have been erased while copies were made
            used, since = _list_used(c), erasure.list_erased_spaces(c, {f.space for f in group})
            for stored in group:
                if (stored.space, stored.name) in used or not blobs.is_older(stored, settings.sweep_grace_s):
                    continue
                count += 1
                if stored.space == INCOMING or stored.space in since:
                    gone.append(stored)
                else:
                    removable.append((stored.space, stored.name))
            blobs.discard(gone)
            trash.take(removable, time)
        trash.forget(set(going) - set(removable), time)
        trash.settle(removable, time)
        if removable:
            log.warning("%d stored files that nothing refers to are in %s now", len(removable), trash.place)
    trash.expire(now())
    with db.read() as c:
        erased = erasure.list_erased_spaces(c)
    # a sweep killed between copying and taking leaves copies
    if left := [one for one in trash.files() if one.space in erased]:
        trash.drop(left)
    return count


def _list_used(c: Connection) -> set[tuple[str, str]]:
    """(space, name) of every referenced file, including unfinished uploads."""
    return list_referenced(c) | {(INCOMING, name) for name in uploads.list_parts(c)}


def put_back(db: Database, blobs: BlobStore) -> int:
    """Restore missing referenced files from the trash; return their number."""
    trash = blobs.trash
    back = 0
    with db.write() as c:
        used = list_referenced(c)
        for one in list(trash.files()):
            if (one.space, one.name) in used and not blobs.has(one.space, one.name):
                trash.put_back(one)
                back += 1
    if back:
        trash.tidy()
    return back
