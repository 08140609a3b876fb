"""One row of everything that belongs to a patient, and the ids needed by the routes."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Mapping
from typing import Any, Final

from sqlalchemy import insert

from sagittal.server.auth.tokens import token_hash
from sagittal.server.clinic import identities, programmes
from sagittal.server.results import prescriptions
from sagittal.server.storage.field_cipher import make_keys
from sagittal.server.storage.schema.care_tables import emergency_access
from sagittal.server.storage.schema.live_tables import live_take
from sagittal.server.storage.schema.person_tables import consent
from sagittal.server.storage.schema.report_tables import report_link, signed_report
from sagittal.server.storage.schema.tables import (
    analysis,
    analysis_file,
    file_upload,
    filter_run,
    new_id,
    now,
    patient,
    patient_note,
    recording,
    reference_file,
    session,
    tuning,
)
from tests.helpers.clinic import Clinic
from tests.server import analysed, crowd

TRAINING: Final = {
    "parameter": "stance_pct",
    "side": "left",
    "target": {"source": "manual", "mean": 62.0, "sd": 2.0},
}
OF_NOBODY: Final = {
    "device_id": crowd.DEVICES[0],
    "view_id": "0" * 32,
    "number": "0",
    "language": "en",
    "version": "none",
}
"""Parts of addresses that name nothing of a patient."""


def add_belongings(clinic: Clinic, code: str) -> dict[str, str]:
    """Add a patient to whom one of everything belongs; returns values by the names in addresses."""
    ((second, sid),) = crowd.fill(clinic, 1, 2, analysed.files())
    locum = clinic.user("clinician", "locum")
    stamp, later = now(), now() + dt.timedelta(days=1)
    ids = {name: new_id() for name in (
        "note_id", "consent_id", "upload_id", "tuning_id",
        "access_id", "run_id", "report_id", "link_id", "take_id",
    )}  # fmt: skip
    with clinic.db.write() as c:
        pid = c.execute(session.select().where(session.c.id == sid)).one().patient_id
        took = c.execute(recording.select().where(recording.c.session_id == sid)).one().id
        done = c.execute(analysis.select().where(analysis.c.recording_id == took)).one()
        of_visit, of_patient = {"session_id": sid}, {"patient_id": pid}
        if not clinic.settings.identity_key_file.exists():
            make_keys(clinic.settings.identity_key_file)
        identities.change(c, clinic.settings.identity_key_file, None, pid, {"name": f"Person {code}"})
        written = prescriptions.write(c, clinic.app.state.reviewed, None, pid, TRAINING)
        course = programmes.start(c, None, pid, starts_on=stamp.date())
        single = {"job_id": done.job_id, "created_at": stamp, "code_version": "1"}
        sha = token_hash(ids["link_id"])
        c.execute(patient.update().where(patient.c.id == pid).values(code=code, note=f"note of {code}"))
        c.execute(session.update().where(session.c.patient_id == pid).values(title=f"visit of {code}"))
        for table, row in (
            (emergency_access, {"id": ids["access_id"], **of_patient, "user_id": locum,
                                "reason": f"{code} fell", "opened_at": stamp - dt.timedelta(hours=5),
                                "ends_at": stamp - dt.timedelta(hours=1)}),
            (patient_note, {"id": ids["note_id"], **of_patient, "written_on": stamp.date(),
                            "created_at": stamp, "content": f"{code} limps"}),
            (consent, {"id": ids["consent_id"], **of_patient, "purpose": "sharing", "given_on": stamp.date(),
                       "evidence": f"form of {code}", "created_at": stamp}),
            (file_upload, {"id": ids["upload_id"], **of_visit, "name": "b.csv", "size": 9,
                           "created_at": stamp}),
            (reference_file, {**of_visit, "name": "optical.sto", "size": 1, "sha256": sha,
                              "added_at": stamp}),
            (tuning, {"id": ids["tuning_id"], "recording_id": took, "input_sha256": sha, "result": {},
                      **single}),
            (filter_run, {"id": ids["run_id"], "analysis_id": done.id, "settings": {}, **single}),
            (signed_report, {"id": ids["report_id"], **of_visit, "number": 1, "analysis_id": done.id,
                             "language": "en", "signed_at": stamp}),
            (report_link, {"id": ids["link_id"], "report_id": ids["report_id"], "token_sha256": sha,
                           "made_at": stamp, "expires_at": later, "openings": 0}),
            (live_take, {"id": ids["take_id"], **of_visit, "state": "open", "created_at": stamp,
                         "token_sha256": sha, "token_expires_at": later}),
            (analysis_file, {"analysis_id": done.id, "name": f"sensitivity-{done.job_id[:8]}.json", "size": 2,
                             "sha256": sha}),
        ):  # fmt: skip
            c.execute(insert(table).values(row))
    return ids | {
        "prescription_id": written.id,
        "programme_id": course.id,
        "visit_id": course.visits[0].id,
        "pid": pid,
        "patient_id": pid,
        "sid": sid,
        "session_id": sid,
        "other": second,
        "other_id": second,
        "analysis_id": done.id,
        "job_id": done.job_id,
        "sensitivity_id": done.job_id,
    }


def fill_address(route: str, values: Mapping[str, str]) -> str:
    """The address of a route with its parts filled; KeyError for a part that this does not know."""
    path = route.partition(" ")[2]
    named: Mapping[str, Any] = {"references": "optical.sto", "files": "walk.txt", "signals": "foot_pitch"}

    def value(result: re.Match[str]) -> str:
        initial = path[: result.start()].rstrip("/").rsplit("/", 1)[-1]
        if result[1] == "name":
            return str(named.get(initial, "stance_pct"))
        return values[result[1]]

    return re.sub(r"\{(\w+)(?::path)?\}", value, path)
