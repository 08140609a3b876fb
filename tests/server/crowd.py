"""Bulk creation of many patients with analysed visits, for page cost measurements."""

from __future__ import annotations

import contextlib
import datetime as dt
from collections.abc import Iterator, Mapping
from contextvars import ContextVar
from typing import Any

from sqlalchemy import Engine, Table, event, insert

from sagittal.core.frames import SEGMENTS
from sagittal.core.quality.devices import DeviceCheck
from sagittal.server.provenance import CODE_VERSION
from sagittal.server.storage.files.blobs import Blob
from sagittal.server.storage.schema.tables import (
    analysis,
    analysis_file,
    device_check,
    job,
    new_id,
    patient,
    recording,
    recording_file,
    session,
)
from tests.helpers.clinic import Clinic

FIRST_DAY = dt.date(2024, 1, 1)
MORNING = dt.datetime(2024, 1, 1, 8, tzinfo=dt.UTC)

TABLES = (patient, session, recording, recording_file, job, analysis, analysis_file, device_check)

DEVICES = tuple(f"00B4290{i}" for i in range(7))
"""Worn in every visit."""
Rows = dict[Table, list[dict[str, Any]]]


def fill(
    clinic: Clinic,
    patients: int,
    visits: int,
    results: Mapping[str, bytes] | None = None,
    *,
    controls: bool = False,
) -> list[list[str]]:
    """Add people with one visit on each of `visits` days; return each person's sessions, oldest first.

    Parameters
    ----------
    results : analysis files of every visit; None = unreadable files.
    controls : the people serve as the clinic's reference.
    """
    rows: Rows = {table: [] for table in TABLES}
    people = []
    for _ in range(patients):
        person = new_id()
        rows[patient].append(
            {"id": person, "code": f"C-{person[:12]}", "sex": "male", "birth_year": 1960, "height_m": 1.75,
             "is_control": controls, "note": "", "created_at": MORNING}
        )  # fmt: skip
        blobs = clinic.app.state.blobs
        stored = {name: blobs.put(person, content) for name, content in (results or {}).items()}
        people.append([_visit(rows, person, day, stored) for day in range(visits)])
    with clinic.db.write() as c:
        for table, result in rows.items():
            if result:
                c.execute(insert(table), result)
    return people


def _visit(rows: Rows, person: str, day: int, stored: Mapping[str, Blob]) -> str:
    sid, rid, jid, aid = (new_id() for _ in range(4))
    position = MORNING + dt.timedelta(days=day)
    mapped = {"sensors": {"A1": "pelvis"}}
    rows[session].append(
        {"id": sid, "patient_id": person, "title": "Walk", "performed_on": FIRST_DAY + dt.timedelta(days=day),
         "protocol": "walk", "note": "", "created_at": position}
    )  # fmt: skip
    rows[recording].append(
        {"id": rid, "session_id": sid, "manifest": mapped, "wanted_key": rid, "created_at": position}
    )
    rows[recording_file].append(
        {"recording_id": rid, "name": "walk.txt", "size": 9, "sha256": "0" * 64, "added_at": position}
    )
    rows[job].append(
        {"id": jid, "key": rid, "kind": "analyse", "recording_id": rid, "params": {}, "priority": 0,
         "state": "done", "attempt": 1, "deaths": 0, "cancel_requested": False, "created_at": position,
         "started_at": position, "finished_at": position}
    )  # fmt: skip
    rows[analysis].append(
        {"id": aid, "recording_id": rid, "job_id": jid, "input_sha256": "0" * 64, "config_sha256": "0" * 64,
         "code_version": CODE_VERSION, "manifest": mapped, "config": {}, "created_at": position}
    )  # fmt: skip
    rows[device_check] += [
        {"recording_id": rid, "device_id": device, "segment": segment, "exchanged": False, "at": position,
         "content": DeviceCheck(device, 100.0, reason="no_rest").to_json()}
        for device, segment in zip(DEVICES, SEGMENTS, strict=False)
    ]  # fmt: skip
    rows[analysis_file] += [
        {"analysis_id": aid, "name": name, "size": blob.size, "sha256": blob.sha256}
        for name, blob in stored.items()
    ]
    return sid


@contextlib.contextmanager
def statements() -> Iterator[list[str]]:
    """SQL statements executed meanwhile, without those that begin transactions."""
    sent: list[str] = []

    def note(c: object, cursor: object, statement: str, *remainder: object) -> None:
        if _asking.get() and not statement.startswith("BEGIN"):
            sent.append(statement)

    event.listen(Engine, "before_cursor_execute", note)
    token = _asking.set(True)
    try:
        yield sent
    finally:
        _asking.reset(token)
        event.remove(Engine, "before_cursor_execute", note)


_asking: ContextVar[bool] = ContextVar("asking", default=False)
"""Goes with a request into the threads that answer it, and not into those of the server itself."""
