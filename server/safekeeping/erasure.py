"""Permanent deletion of a session or patient: rows in one transaction, then files; the audit log remains.

Erased data do not go to the trash; copies in the trash and old pages of the database's write-ahead log are
removed as well. A note in `erasing/` is written before the rows are deleted and removed after the files:
after a crash the erasure is completed at the next start or sweep (`finish`). A running job loses its row, so
its worker fails at the fence and publishes nothing.
"""

from __future__ import annotations

import json
import logging
import re
import sqlite3
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, delete, select, update
from sqlalchemy.exc import SQLAlchemyError

from sagittal.core.formats.json_tree import read_json
from sagittal.core.message import Message
from sagittal.server import audit
from sagittal.server.clinic import patients, sessions
from sagittal.server.errors import Conflict
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.settings import Settings
from sagittal.server.storage import fs
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blobs import BlobStore, StoreAway
from sagittal.server.storage.references import discard, list_referenced
from sagittal.server.storage.schema.care_tables import care_team_member, emergency_access
from sagittal.server.storage.schema.live_tables import live_event, live_take
from sagittal.server.storage.schema.person_tables import consent, patient_identity
from sagittal.server.storage.schema.report_tables import assessment, report_file, report_link, signed_report
from sagittal.server.storage.schema.tables import (
    analysis,
    analysis_file,
    device_check,
    edit,
    file_upload,
    filter_run,
    filter_run_file,
    job,
    new_id,
    patient,
    patient_note,
    planned_visit,
    prescription,
    programme,
    recording,
    recording_file,
    reference_file,
    session,
    session_video,
    tuning,
)
from sagittal.server.storage.schema.tables import audit as audit_table

log = logging.getLogger(__name__)

ERASED = "patient.erased"
SESSION_ERASED = "session.erased"
_ID = re.compile(r"[0-9a-f]{32}")


def erase_patient(
    db: Database,
    reviewed: ReviewedAnalyses,
    settings: Settings,
    actor: audit.Actor | None,
    patient_id: str,
    *,
    confirm: str,
) -> None:
    """Erase a patient with all data; `confirm` repeats the code, otherwise Conflict not_confirmed."""
    with db.write() as c:
        target = patients.get(c, patient_id)
        if confirm.strip() != target.code:
            raise Conflict(
                "not_confirmed",
                Message("To delete this patient for good, repeat the code '{code}'.", code=target.code),
            )
        mine = select(session.c.id).where(session.c.patient_id == patient_id)
        parts = list(c.execute(select(file_upload.c.id).where(file_upload.c.session_id.in_(mine))).scalars())
        takes = [
            take
            for session_id in c.execute(mine).scalars().all()
            for take in _erase_session_rows(c, session_id)
        ]
        plans = select(programme.c.id).where(programme.c.patient_id == patient_id).scalar_subquery()
        c.execute(delete(planned_visit).where(planned_visit.c.programme_id.in_(plans)))
        c.execute(delete(programme).where(programme.c.patient_id == patient_id))
        c.execute(delete(prescription).where(prescription.c.patient_id == patient_id))
        c.execute(delete(patient_note).where(patient_note.c.patient_id == patient_id))
        for table in (patient_identity, consent, care_team_member, emergency_access):
            c.execute(delete(table).where(table.c.patient_id == patient_id))
        c.execute(delete(patient).where(patient.c.id == patient_id))
        audit.record(c, actor, ERASED, "patient", patient_id, {"sessions": target.sessions})
        _note(settings, spaces=[patient_id], takes=takes, parts=parts)
    reviewed.forget()
    finish(db, reviewed.blobs, settings)


def erase_session(
    db: Database, reviewed: ReviewedAnalyses, settings: Settings, actor: audit.Actor | None, session_id: str
) -> None:
    """Erase one session with its recordings and results; raises NotFound."""
    with db.write() as c:
        target = sessions.get(c, session_id)
        own = _files_of(c, session_id, target.patient_id)
        mine = select(file_upload.c.id).where(file_upload.c.session_id == session_id)
        parts = list(c.execute(mine).scalars())
        takes = _erase_session_rows(c, session_id)
        audit.record(c, actor, SESSION_ERASED, "session", session_id, {"patient_id": target.patient_id})
        _note(settings, files=sorted(own), takes=takes, parts=parts)
    reviewed.forget()
    finish(db, reviewed.blobs, settings)


def _erase_session_rows(c: Connection, session_id: str) -> list[str]:
    """Delete the rows and return the ids of their live trials."""
    takes = list(c.execute(select(live_take.c.id).where(live_take.c.session_id == session_id)).scalars())
    c.execute(delete(live_event).where(live_event.c.take_id.in_(takes)))
    c.execute(delete(live_take).where(live_take.c.id.in_(takes)))
    recordings = select(recording.c.id).where(recording.c.session_id == session_id).scalar_subquery()
    analyses = select(analysis.c.id).where(analysis.c.recording_id.in_(recordings)).scalar_subquery()
    runs = select(filter_run.c.id).where(filter_run.c.analysis_id.in_(analyses)).scalar_subquery()
    c.execute(delete(filter_run_file).where(filter_run_file.c.filter_run_id.in_(runs)))
    c.execute(delete(filter_run).where(filter_run.c.analysis_id.in_(analyses)))
    c.execute(delete(reference_file).where(reference_file.c.session_id == session_id))
    c.execute(delete(file_upload).where(file_upload.c.session_id == session_id))
    c.execute(delete(session_video).where(session_video.c.session_id == session_id))
    signed = select(signed_report.c.id).where(signed_report.c.session_id == session_id).scalar_subquery()
    c.execute(delete(report_link).where(report_link.c.report_id.in_(signed)))
    c.execute(delete(report_file).where(report_file.c.report_id.in_(signed)))
    c.execute(delete(signed_report).where(signed_report.c.session_id == session_id))
    c.execute(delete(assessment).where(assessment.c.session_id == session_id))
    c.execute(delete(edit).where(edit.c.analysis_id.in_(analyses)))
    c.execute(delete(analysis_file).where(analysis_file.c.analysis_id.in_(analyses)))
    c.execute(delete(analysis).where(analysis.c.recording_id.in_(recordings)))
    c.execute(delete(tuning).where(tuning.c.recording_id.in_(recordings)))
    c.execute(delete(job).where(job.c.recording_id.in_(recordings)))
    c.execute(delete(device_check).where(device_check.c.recording_id.in_(recordings)))
    c.execute(delete(recording_file).where(recording_file.c.recording_id.in_(recordings)))
    c.execute(delete(recording).where(recording.c.session_id == session_id))
    # the plan outlives the session: its visit is open again
    c.execute(update(planned_visit).where(planned_visit.c.session_id == session_id).values(session_id=None))
    c.execute(delete(session).where(session.c.id == session_id))
    return takes


def finish(db: Database, blobs: BlobStore, settings: Settings) -> None:
    """Remove the files of every erasure whose rows are deleted; failures are retried later."""
    for path in sorted(settings.erasing.glob("*.json")):
        note = _read(path)
        if note is None:
            log.error("%s cannot be read; what it was to erase is not known any more", path)
            continue
        try:
            # detect an unavailable store before acquiring the lock, for which others wait
            blobs.has("0" * 32, "0" * 64)
            _remove(db, blobs, settings, note)
            is_gone = db.fold()
        except (OSError, sqlite3.Error, SQLAlchemyError, StoreAway):
            log.exception("what %s is to erase cannot be removed; it will be tried again", path.name)
            continue
        if not is_gone:
            log.warning("what %s is to erase is still being read; it will be tried again", path.name)
            continue
        fs.remove_file(path)
        fs.sync_folder(path.parent)


def list_erased_spaces(c: Connection, among: Collection[str] | None = None) -> set[str]:
    """Ids of all erased patients, or of those among some, from the audit log."""
    query = select(audit_table.c.resource_id).where(audit_table.c.action == ERASED)
    if among is not None:
        query = query.where(audit_table.c.resource == "patient", audit_table.c.resource_id.in_(among))
    ids = set(c.execute(query).scalars())
    return ids - set(c.execute(select(patient.c.id)).scalars())


def list_unfinished(settings: Settings) -> tuple[set[str], set[str]]:
    """Patients and live trials of unfinished erasures."""
    notes = [note for path in settings.erasing.glob("*.json") if (note := _read(path)) is not None]
    return {x for note in notes for x in note["spaces"]}, {x for note in notes for x in note["takes"]}


def _files_of(c: Connection, session_id: str, patient_id: str) -> set[tuple[str, str]]:
    """All files of a session, including removed ones that may be in the trash."""
    added = select(audit_table.c.detail["sha256"].as_string()).where(
        audit_table.c.action.in_(("recording.file_added", "reference.added", "video.added")),
        audit_table.c.detail["session_id"].as_string() == session_id,
    )
    earlier = {(patient_id, sha256) for sha256 in c.execute(added).scalars() if sha256}
    return earlier | {one for one in list_referenced(c, session_id) if one[0] == patient_id}


def _note(
    settings: Settings,
    *,
    spaces: Iterable[str] = (),
    files: Iterable[tuple[str, str]] = (),
    takes: Iterable[str] = (),
    parts: Iterable[str] = (),
) -> None:
    """Durably record ids and hashes that are about to be erased."""
    fs.make_folder(settings.erasing)
    content = {"spaces": list(spaces), "files": list(files), "takes": list(takes), "parts": list(parts)}
    fs.write_file(settings.erasing / f"{new_id()}.json", json.dumps(content).encode())


def _read(path: Path) -> dict[str, Any] | None:
    try:
        note: Any = read_json(path.read_bytes())
        # earlier versions had no parts
        spaces, takes, parts = ([str(x) for x in note.get(key, [])] for key in ("spaces", "takes", "parts"))
        files = [(str(space), str(name)) for space, name in note["files"]]
        if not all(map(_ID.fullmatch, [*spaces, *takes, *parts, *(space for space, _ in files)])):
            return None
    except FileNotFoundError:  # another process has just finished it
        return {"spaces": [], "files": [], "takes": [], "parts": []}
    except (ValueError, TypeError, KeyError, AttributeError):
        return None
    return {"spaces": spaces, "files": files, "takes": takes, "parts": parts}


def _remove(db: Database, blobs: BlobStore, settings: Settings, note: dict[str, Any]) -> None:
    """Remove the content of a note unless rows still refer to it, as after an aborted erasure.

    Only files that may be stored again are removed under the write lock, some at a time, when the author of
    the note has committed or aborted; erased patients, trials and uploads never return.
    """
    with db.write() as c:
        spaces, takes, parts = (
            set(note[key]) - set(c.execute(select(ids).where(ids.in_(note[key]))).scalars())
            for key, ids in (("spaces", patient.c.id), ("takes", live_take.c.id), ("parts", file_upload.c.id))
        )
        used = list_referenced(c) if note["files"] else set()
    trash = blobs.trash
    for space in spaces:
        blobs.erase(space)
        trash.remove(space)
    of_files: dict[str, list[str]] = {}
    for space, name in note["files"]:
        if (space, name) not in used:
            of_files.setdefault(space, []).append(name)
    for space, names in of_files.items():
        discard(db, blobs, space, names)
        trash.remove(space, names)
    for take in takes:
        for path in (one for folder in settings.live_folders for one in folder.glob(f"{take}.*")):
            fs.remove_file(path)
    for part in parts:
        fs.remove_file(blobs.part(part))
    blobs.settle(of_files)
    for folder in (blobs.incoming, *settings.live_folders):
        if folder.is_dir():
            fs.sync_folder(folder)
    with db.write():  # a sweep creates folders there under this lock
        trash.tidy()
