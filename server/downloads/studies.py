"""Studies: the selected visits and their current analyses as two tables.

Nothing is recomputed or stored: the tables are built from stored analyses and users' edits, in a separate
process (study_child.py). Patients and visits are identified by the pseudonyms of the other exports; dates and
notes are omitted.
"""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import Connection

from sagittal.core.errors import SagittalError
from sagittal.core.frames import Protocol
from sagittal.core.message import Message
from sagittal.server.auth.identity import Identity
from sagittal.server.clinic import patients, sessions
from sagittal.server.clinic.patients import Patient
from sagittal.server.clinic.sessions import Session
from sagittal.server.downloads.exports import make_pseudonym
from sagittal.server.errors import Conflict
from sagittal.server.export.ages import coarsen_age
from sagittal.server.provenance import CODE_VERSION
from sagittal.server.report.files.analysis_json import parameter_row
from sagittal.server.report.files.exports import strides_csv
from sagittal.server.report.study_tables import StudyTables, StudyTake, write_study
from sagittal.server.results import analyses, edit_log
from sagittal.server.results.histories import AnalysedSession
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blobs import StoreAway
from sagittal.server.storage.schema.tables import now
from sagittal.server.uploads import recordings

MOST_VISITS: Final = 300
"""Per study; larger ones must be requested in parts."""


@dataclass(frozen=True)
class StudyChoice:
    """Selection of visits.

    Parameters
    ----------
    search : part of a patient's code or note. protocol : None = any. since, until : dates, inclusive. visits
        : restrict to these; None = all.
    """

    search: str = ""
    protocol: Protocol | None = None
    since: dt.date | None = None
    until: dt.date | None = None
    visits: frozenset[str] | None = None


def list_visits(c: Connection, user: Identity, choice: StudyChoice) -> list[Session]:
    """Selected visits that a user may open, by patient and date."""
    if choice.visits is not None and not choice.visits:
        return []
    return sessions.search(
        c,
        user,
        search=choice.search,
        protocol=choice.protocol,
        since=choice.since,
        until=choice.until,
        ids=choice.visits or (),
    )


def check_size(chosen: Sequence[Session]) -> None:
    """Reject a study with no visits or too many; raises Conflict no_visits, too_many_visits."""
    if not chosen:
        raise Conflict("no_visits", "No visit matches. Choose another period or protocol.")
    if len(chosen) > MOST_VISITS:
        raise Conflict(
            "too_many_visits",
            Message(
                "{chosen} visits match; a study can have at most {MOST_VISITS}. Choose shorter periods and "
                "merge the tables.",
                chosen=len(chosen),
                MOST_VISITS=MOST_VISITS,
            ),
        )


def make_study(
    db: Database, reviewed: ReviewedAnalyses, user: Identity, choice: StudyChoice
) -> tuple[StudyTables, list[str]]:
    """Write the tables of a selection and list the visits they contain.

    Raises
    ------
    Conflict
        no_visits, too_many_visits.
    """
    with db.read() as c:
        chosen = list_visits(c, user, choice)
        check_size(chosen)
        people = {p: patients.get(c, p) for p in dict.fromkeys(s.patient_id for s in chosen)}
        records = analyses.latest_of(c, [s.id for s in chosen])
        edits = edit_log.edits_of_all(c, [record.id for record in records.values()])
        recorded = {s: recordings.get(c, record.recording_id) for s, record in records.items()}
    first: dict[str, dt.date] = {}
    for s in chosen:
        first[s.patient_id] = min(s.performed_on, first.get(s.patient_id, s.performed_on))
    takes = []
    for s in chosen:
        person, name = people[s.patient_id], _name(s)
        record = records.get(s.id)
        labels = _label(person, s, first[s.patient_id])
        if record is None:
            lacking = SagittalError("no_analysis", "This visit has no analysis. Analyse or exclude it.")
            takes.append(StudyTake(name, labels, 0, {}, lacking, dict, lambda: None))
        else:
            done = AnalysedSession(s, record, edits[record.id])
            labels |= {"condition": done.condition.words, "edits": len(done.edits.made)}
            files = {f.name: f.sha256 for f in recorded[s.id].files}
            takes.append(_open_take(reviewed, name, labels, files, done))
    about = {
        "written_by": CODE_VERSION,
        "written_at": now().isoformat(timespec="seconds"),
        "analyses": {
            _name(s): {"analysed_by": record.code_version, "config": dict(record.config)}
            for s in chosen
            if (record := records.get(s.id)) is not None
        },
    }
    return write_study(takes, about), [s.id for s in chosen]


def _open_take(
    reviewed: ReviewedAnalyses,
    name: str,
    labels: Mapping[str, object],
    files: Mapping[str, str],
    done: AnalysedSession,
) -> StudyTake:
    """Current result of a visit; an unreadable one is reported, without affecting the others."""
    record, edits = done.found, done.edits
    error, strides, analysis = None, None, {}
    try:
        analysis = json.loads(analyses.file_bytes(reviewed.blobs, record, "analysis.json"))
        result = reviewed.measure(record, edits)
        if result is not None:
            strides = strides_csv(result.strides, result.columns)
            bundle = reviewed.read_bundle(record, edits)
            analysis["parameters"] = [parameter_row(p) for p in bundle.parameters]
        elif "strides.csv" in record.files:
            strides = analyses.file_bytes(reviewed.blobs, record, "strides.csv")
    except StoreAway:
        raise  # the problem is not this visit's data
    except SagittalError as refused:
        error = refused
    return StudyTake(name, labels, len(files), _hide_names(files), error, lambda: analysis, lambda: strides)


def _hide_names(files: Mapping[str, str]) -> dict[str, str]:
    """Replace file names in hashes by numbers, as files may be named after patients."""
    return {f"file-{number}": sha256 for number, sha256 in enumerate(files.values(), 1)}


def _name(session: Session) -> str:
    return f"sub-{make_pseudonym(session.patient_id)}/ses-{make_pseudonym(session.id)}"


def _label(person: Patient, session: Session, first: dt.date) -> dict[str, Any]:
    return {
        "sub": make_pseudonym(person.id),
        "ses": make_pseudonym(session.id),
        "days_since_first": (session.performed_on - first).days,
        "protocol": session.protocol,
        "sex": person.sex,
        "age_years": coarsen_age(person.find_age(session.performed_on)),
        "height_m": person.find_height(session),
        "affected_side": person.affected_side,
        "is_control": person.is_control,
    }
