"""Rows of the audit trail as sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import Connection, Row, select

from sagittal.core.user_text import UserText
from sagittal.server.storage.schema.care_tables import emergency_access
from sagittal.server.storage.schema.tables import patient, session
from sagittal.web.words import day

DEEDS: Final[Mapping[str, str]] = {
    "sign_in": "signed in",
    "sign_in.one_time": "signed in with a one-time address",
    "sign_in.failed": "failed to sign in",
    "sign_out": "signed out",
    "user.set_up": "created the first account",
    "user.created": "created an account",
    "user.changed": "changed an account",
    "user.password_changed": "changed the password",
    "user.language_chosen": "changed the display language",
    "user.second_factor_on": "set up a second factor",
    "user.second_factor_off": "removed the second factor",
    "user.second_factor_reset": "removed the second factor of an account",
    "user.recovery_code_used": "used a recovery code",
    "user.security_key_added": "set up a security key",
    "user.security_key_refused": "tried to set up a security key, which was refused",
    "user.security_key_removed": "removed a security key",
    "user.keys_only": "restricted sign-in to security keys",
    "user.codes_again": "allowed sign-in with codes in addition to security keys",
    "token.made": "created an API token",
    "token.revoked": "revoked an API token",
    "patient.listed": "viewed the patient list",
    "patient.opened": "opened the patient",
    "patient.created": "added the patient",
    "patient.changed": "edited the patient record",
    "patient.code_refused": "tried to reuse the patient's code from outside the care team",
    "patient.hidden": "tried to open the patient, from outside the care team",
    "patient.exported": "exported all data of the patient",
    "patient.deidentified": "exported results of the patient for research, without the name",
    "care_teams.on": "turned on care teams",
    "care_teams.off": "turned off care teams: all users see all patients",
    "care_team.changed": "changed the care team of the patient",
    "care_team.opened": "viewed the care team of the patient",
    "emergency.opened": "opened the patient with emergency access from outside the care team",
    "emergency.ended": "ended an emergency access",
    "emergency.refused": "requested emergency access with an unknown patient code",
    "patient.erased": "deleted the patient with all recordings",
    "note.added": "wrote a note",
    "note.removed": "removed a note",
    "consent.given": "recorded a consent of the patient",
    "consent.withdrawn": "recorded the withdrawal of a consent",
    "consents.opened": "viewed the consents of the patient",
    "identity.opened": "viewed the identity of the patient",
    "identity.changed": "changed the identity of the patient",
    "identity.printed": "put the patient's name on a report",
    "identity.discarded": "removed the patient's identity, which no key could decrypt",
    "identities.key_changed": "changed the encryption key of patient names",
    "notes.opened": "read the notes",
    "sessions.opened": "listed the visits",
    "trends.opened": "viewed the trends",
    "session.opened": "opened the visit",
    "session.created": "added the visit",
    "session.changed": "edited the visit",
    "session.erased": "deleted the visit with its recording",
    "comparison.opened": "compared the visit with another one",
    "recording.opened": "viewed the recorded files",
    "recording.file_opened": "downloaded a recorded file",
    "recording.file_added": "added a recorded file",
    "recording.file_removed": "removed a recorded file",
    "upload.begun": "started uploading a large file",
    "upload.cancelled": "cancelled the upload of a large file",
    "uploads.opened": "listed the unfinished uploads",
    "recording.inspected": "started reading the recorded files",
    "recording.mapped": "assigned the sensors to segments",
    "analyses.opened": "listed the analyses",
    "analysis.opened": "opened an analysis",
    "analysis.file_opened": "downloaded a file of an analysis",
    "analysis.requested": "requested an analysis",
    "report.opened": "read the report",
    "assessment.written": "wrote the assessment on the report",
    "signed_report.signed": "signed the report",
    "signed_report.reopened": "reopened the signed report",
    "signed_report.opened": "read the signed report",
    "signed_reports.opened": "listed the signed reports",
    "leaflet.opened": "opened the leaflet for the patient",
    "course.opened": "opened the report over the visits",
    "report_link.made": "created a link to the signed report",
    "report_link.revoked": "revoked a link to the signed report",
    "report_link.refused": "opened an invalid report link",
    "report_link.opened": "read the signed report through a link",
    "study.exported": "exported the values of the visit in study tables",
    "archive.opened": "downloaded the archive of a visit",
    "numbers.opened": "viewed the values",
    "parameter.opened": "viewed the strides of a value",
    "signals.opened": "viewed the signals",
    "replay.opened": "viewed the avatar",
    "review.opened": "viewed the manual changes",
    "events.opened": "viewed the events",
    "strides.opened": "viewed the strides",
    "event.moved": "moved an event",
    "event.added": "added an event",
    "event.deleted": "deleted an event",
    "stride.left_out": "excluded a stride",
    "stride.counted": "included a stride",
    "edit.undone": "undid the last manual change",
    "edit.redone": "redid the last undone manual change",
    "filters.requested": "requested a comparison of filters",
    "filter_runs.opened": "listed the comparisons of filters",
    "filter_run.opened": "opened a comparison of filters",
    "filter_run.file_opened": "downloaded a file of a comparison of filters",
    "references.opened": "listed the reference files",
    "reference.opened": "downloaded a reference file",
    "reference.added": "added a reference file",
    "reference.removed": "removed a reference file",
    "video.added": "added a video to the trial and confirmed the person's consent",
    "video.begun": "started filming a trial and confirmed the person's consent",
    "video.discarded": "discarded the video of an abandoned trial",
    "video.aligned": "aligned the video with the trial",
    "video.removed": "removed the video",
    "video.opened": "viewed the video",
    "export.requested": "requested an export file",
    "exports.opened": "listed the export files",
    "sensitivity.requested": "requested a sensitivity analysis",
    "sensitivities.opened": "listed the sensitivity analyses",
    "sensitivity.opened": "opened a sensitivity analysis",
    "tuning.requested": "requested the tuning of a filter",
    "tunings.opened": "listed the filter tunings",
    "tuning.opened": "opened a filter tuning",
    "prescription.written": "prescribed feedback",
    "prescription.ended": "ended the feedback prescription",
    "prescriptions.opened": "listed the prescriptions",
    "targets.opened": "viewed targets for feedback",
    "feedback.opened": "viewed the feedback results",
    "programme.started": "planned a programme",
    "programme.ended": "ended the programme",
    "programme.visit_changed": "changed a visit of the programme",
    "programmes.opened": "viewed the programme",
    "live.opened": "opened a live recording",
    "live.code_given": "requested a new tablet code",
    "live.paired": "paired a tablet",
    "live.watched": "watched the live recording",
    "live.events_opened": "viewed the marks of the live recording",
    "live.adopted": "resumed a live recording after a restart",
    "live.finished": "ended a live recording",
    "live.closed": "closed a live recording",
    "job.listed": "viewed the job list",
    "job.opened": "viewed a job",
    "job.cancelled": "cancelled a job",
    "backup.made": "created a full backup",
    "backup.restored": "restored a backup",
    "database.accepted": "accepted this database as the clinic's own",
}
"""Action → description that follows the user's name."""

SIGNED_IN_BY: Final[Mapping[str, str]] = {
    "password": "signed in with password only",
    "code": "signed in with password and code",
    "recovery_code": "signed in with password and recovery code",
    "security_key": "signed in with password and security key",
}
"""Factor of a sign-in (`accounts.Factor`) → description; older rows have none."""

NOBODY: Final = "The system"
STRANGER: Final = "Someone"
BY_STRANGERS: Final = ("sign_in.failed", "report_link.opened", "report_link.refused")


@dataclass(frozen=True)
class AuditSentence:
    """A row of the audit trail in words.

    Parameters
    ----------
    who, deed : "anna", "opened the visit". whom : code of the patient, None without one or if deleted.
    of : date of the visit. href : link to the resource, None if deleted. why : stated reason, None = none, or
        the patient is deleted.
    row : the row itself.
    """

    who: str
    deed: str
    whom: str | None
    of: str | None
    href: str | None
    why: str | None
    row: Row[Any]


def describe_rows(c: Connection, rows: Sequence[Row[Any]]) -> list[AuditSentence]:
    """Describe rows in words, with patients and visits as far as they still exist."""
    ids = {row.resource_id for row in rows if row.resource in {"patient", "session"}}
    people = c.execute(select(patient.c.id, patient.c.code).where(patient.c.id.in_(ids)))
    codes = {row.id: row.code for row in people}
    query = select(session.c.id, session.c.performed_on, patient.c.code).join(patient)
    visits = {r.id: r for r in c.execute(query.where(session.c.id.in_(ids)))}
    accesses = [row.detail.get("access") for row in rows if row.action == "emergency.opened"]
    reasons_query = select(emergency_access.c.id, emergency_access.c.reason).where(
        emergency_access.c.id.in_(accesses)
    )
    reasons = {r.id: r.reason for r in c.execute(reasons_query)} if accesses else {}
    sentences = []
    for row in rows:
        stated_reason = reasons.get(row.detail.get("access"))
        visit = visits.get(row.resource_id)
        code = codes.get(row.resource_id)
        patient_code, date, href = code, None, None if code is None else f"/patients/{row.resource_id}"
        if visit is not None:
            patient_code, date, href = visit.code, day(visit.performed_on), f"/sessions/{visit.id}"
        sentences.append(
            AuditSentence(
                _name(row),
                describe_deed(row.action, row.detail),
                patient_code,
                date,
                href,
                stated_reason,
                row,
            )
        )
    return sentences


def describe_deed(action: str, detail: Mapping[str, Any] | None = None) -> str:
    """Description of an action, with the factor of a sign-in; an unknown action's own name."""
    if action == "sign_in" and detail and detail.get("factor") in SIGNED_IN_BY:
        return SIGNED_IN_BY[detail["factor"]]
    return DEEDS.get(action, action.replace("_", " ").replace(".", ": "))


def _name(row: Row[Any]) -> str:
    if row.user_name:
        return UserText(row.user_name)
    return STRANGER if row.action in BY_STRANGERS else NOBODY
