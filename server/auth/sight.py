"""Access to patients in clinics with care teams: the rule applied to every read.

Administrators see all patients; other users see the patients of their care teams, and those they have opened
in an emergency until that access ends. A route whose path refers to a patient's data is checked by its
dependency (server/auth/access.py); lists use `only_seen`, which their services require.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

from sqlalchemy import ColumnElement, Connection, Row, Select, and_, exists, literal, or_, select, true

from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Role
from sagittal.server.storage.schema.care_tables import care_team_member, clinic_option, emergency_access
from sagittal.server.storage.schema.live_tables import live_take
from sagittal.server.storage.schema.person_tables import consent
from sagittal.server.storage.schema.report_tables import report_link, signed_report
from sagittal.server.storage.schema.tables import (
    analysis,
    file_upload,
    filter_run,
    job,
    now,
    patient,
    patient_note,
    planned_visit,
    prescription,
    programme,
    recording,
    session,
    tuning,
    user,
)

CARE_TEAMS: Final = "care_teams"
"""Name of the option."""

_OF_SESSION: Final = select(session.c.patient_id)
_OF_RECORDING: Final = select(session.c.patient_id).join(recording, recording.c.session_id == session.c.id)
_OF_ANALYSIS: Final = _OF_RECORDING.join(analysis, analysis.c.recording_id == recording.c.id)
_OF_JOB: Final = _OF_RECORDING.join(job, job.c.recording_id == recording.c.id)
_OF_REPORT: Final = _OF_SESSION.join(signed_report, signed_report.c.session_id == session.c.id)

_Owner = tuple[Select[Any], ColumnElement[str]]
OWNER: Final[Mapping[str, _Owner]] = {
    **dict.fromkeys(("patient_id", "pid"), (select(patient.c.id.label("patient_id")), patient.c.id)),
    **dict.fromkeys(("session_id", "sid", "other_id", "other"), (_OF_SESSION, session.c.id)),
    **dict.fromkeys(("job_id", "sensitivity_id"), (_OF_JOB, job.c.id)),
    "analysis_id": (_OF_ANALYSIS, analysis.c.id),
    "run_id": (_OF_ANALYSIS.join(filter_run, filter_run.c.analysis_id == analysis.c.id), filter_run.c.id),
    "tuning_id": (_OF_RECORDING.join(tuning, tuning.c.recording_id == recording.c.id), tuning.c.id),
    "upload_id": (_OF_SESSION.join(file_upload, file_upload.c.session_id == session.c.id), file_upload.c.id),
    "take_id": (_OF_SESSION.join(live_take, live_take.c.session_id == session.c.id), live_take.c.id),
    "report_id": (_OF_REPORT, signed_report.c.id),
    "link_id": (
        _OF_REPORT.join(report_link, report_link.c.report_id == signed_report.c.id),
        report_link.c.id,
    ),
    "access_id": (select(emergency_access.c.patient_id), emergency_access.c.id),
    "note_id": (select(patient_note.c.patient_id), patient_note.c.id),
    "consent_id": (select(consent.c.patient_id), consent.c.id),
    "prescription_id": (select(prescription.c.patient_id), prescription.c.id),
    "programme_id": (select(programme.c.patient_id), programme.c.id),
    "visit_id": (
        select(programme.c.patient_id).join(planned_visit, planned_visit.c.programme_id == programme.c.id),
        planned_visit.c.id,
    ),
}
"""Path parameter that refers to a patient's data → query of the owner, and the column matched by the
parameter.
"""

OF_NOBODY: Final = frozenset(
    {
        "user_id",
        "token_id",
        "key_id",
        "token",  # contains its own authorization
        "device_id",
        "view_id",  # its viewer checks the session it shows (server/viewer/proxy.py)
        "name",  # name of a file or value of the preceding resource
        "number",
        "language",
        "version",
    }
)
"""Path parameters that do not refer to a patient by themselves."""


NOTHING: Final[Mapping[str, str]] = MappingProxyType({})
"""Path parameters of a path without any."""


def only_seen(query: Select[Any], user: Identity | None) -> Select[Any]:
    """Restrict a query over `patient` to those the user may open; None = the system, which sees all."""
    if user is None or user.is_admin:
        return query
    return query.where(~TEAMS_ARE_ON | _is_seen(user.user_id, patient.c.id))


def may_open(c: Connection, identity: Identity, parts: Mapping[str, str]) -> bool:
    """Whether a user may open everything that the path parameters refer to; False if any does not exist."""
    return bool(c.execute(select(opens_parts(parts)).where(user.c.id == identity.user_id)).scalar())


def list_hidden(c: Connection, user_id: str, parts: Mapping[str, str]) -> list[str]:
    """Ids of the patients that path parameters refer to and whose care team does not include the user."""
    hidden_ids: set[str] = set()
    for name in parts.keys() & OWNER.keys():
        query, own = OWNER[name]
        hidden = ~_is_seen(user_id, query.selected_columns[0])
        hidden_ids.update(c.execute(query.where(own == parts[name], hidden)).scalars())
    return sorted(hidden_ids)


def find_emergency(c: Connection, user: Identity | None, patient_id: str) -> Row[Any] | None:
    """The emergency access that alone lets a user see a patient; None if not needed or not granted."""
    if user is None or user.is_admin or not c.execute(select(TEAMS_ARE_ON)).scalar_one():
        return None
    mine = (care_team_member.c.user_id == user.user_id) & (care_team_member.c.patient_id == patient_id)
    if c.execute(select(care_team_member.c.since).where(mine)).first():
        return None
    query = select(emergency_access).where(
        emergency_access.c.user_id == user.user_id,
        emergency_access.c.patient_id == patient_id,
        is_emergency_open(),
    )
    return c.execute(query.order_by(emergency_access.c.ends_at.desc()).limit(1)).first()


def is_emergency_open() -> ColumnElement[bool]:
    """SQL condition: the emergency access is active."""
    time = literal(now(), emergency_access.c.ends_at.type)
    return emergency_access.c.ended_at.is_(None) & (emergency_access.c.ends_at > time)


def opens_parts(parts: Mapping[str, str]) -> ColumnElement[bool]:
    """SQL condition over `user`: access to the path parameters, so that identity and access need one
    query.
    """
    named = [(OWNER[name], value) for name, value in parts.items() if name in OWNER]
    if not named:
        return true()
    owned = [
        exists(query.where(own == value, _is_seen(user.c.id, query.selected_columns[0])))
        for (query, own), value in named
    ]
    return or_(user.c.role == Role.ADMIN.value, ~TEAMS_ARE_ON, and_(*owned))


def sees_patient(patient_id: ColumnElement[str]) -> ColumnElement[bool]:
    """SQL condition over `user`: the account may open the patient."""
    return or_(user.c.role == Role.ADMIN.value, ~TEAMS_ARE_ON, _is_seen(user.c.id, patient_id))


def _is_seen(user_id: str | ColumnElement[str], patient_id: ColumnElement[str]) -> ColumnElement[bool]:
    member = select(care_team_member.c.patient_id).where(care_team_member.c.user_id == user_id)
    opened = select(emergency_access.c.patient_id).where(
        emergency_access.c.user_id == user_id, is_emergency_open()
    )
    return or_(
        patient_id.in_(member.correlate_except(care_team_member)),
        patient_id.in_(opened.correlate_except(emergency_access)),
    )


TEAMS_ARE_ON: Final = exists().where(clinic_option.c.name == CARE_TEAMS)
"""SQL condition: the clinic has care teams."""
