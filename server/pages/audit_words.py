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
    "sign_in.one_time": "signed in by a one-time address",
    "sign_in.failed": "could not sign in",
    "sign_out": "signed out",
    "user.set_up": "made the first account",
    "user.created": "made an account",
    "user.changed": "changed an account",
    "user.password_changed": "changed the password",
    "user.language_chosen": "chose the language of the pages",
    "user.second_factor_on": "set up a second factor",
    "user.second_factor_off": "removed the second factor",
    "user.second_factor_reset": "removed the second factor of an account",
    "user.recovery_code_used": "used a recovery code",
    "user.security_key_added": "set up a security key",
    "user.security_key_refused": "tried to set up a security key, which was refused",
    "user.security_key_removed": "removed a security key",
    "user.keys_only": "chose to sign in by security keys alone",
    "user.codes_again": "chose to sign in by codes as well as by security keys",
    "token.made": "made a token for a program",
    "token.revoked": "revoked a token",
    "patient.listed": "looked at the list of patients",
    "patient.opened": "opened the patient",
    "patient.created": "added the patient",
    "patient.changed": "changed what is said of the patient",
    "patient.code_refused": "tried to give somebody else the code of the patient, from outside the care team",
    "patient.hidden": "tried to open the patient, from outside the care team",
    "patient.exported": "took along everything that is stored of the patient",
    "patient.deidentified": "took along results of the patient for research, without the name",
    "care_teams.on": "switched care teams on",
    "care_teams.off": "switched care teams off: everybody sees every patient",
    "care_team.changed": "changed who is in the care team of the patient",
    "care_team.opened": "looked at the care team of the patient",
    "emergency.opened": "opened the patient in an emergency, from outside the care team",
    "emergency.ended": "ended an access in an emergency",
    "emergency.refused": "asked for a patient in an emergency by a code that nobody has",
    "patient.erased": "deleted the patient with all recordings",
    "note.added": "wrote a note",
    "note.removed": "removed a note",
    "consent.given": "wrote down what the patient agreed to",
    "consent.withdrawn": "wrote down that the patient no longer agrees",
    "consents.opened": "read what the patient agreed to",
    "identity.opened": "looked at who the patient is",
    "identity.changed": "changed who the patient is",
    "identity.printed": "put the patient's name on a report",
    "identity.discarded": "removed who the patient is, which no key could read",
    "identities.key_changed": "changed the key of patients' names",
    "notes.opened": "read the notes",
    "sessions.opened": "listed the visits",
    "trends.opened": "looked at the trends",
    "session.opened": "opened the visit",
    "session.created": "added the visit",
    "session.changed": "changed what is said of the visit",
    "session.erased": "deleted the visit with its recording",
    "comparison.opened": "compared the visit with another",
    "recording.opened": "looked at what was recorded",
    "recording.file_opened": "downloaded a recorded file",
    "recording.file_added": "added a recorded file",
    "recording.file_removed": "removed a recorded file",
    "upload.begun": "began to upload a large file",
    "upload.cancelled": "gave up the upload of a large file",
    "uploads.opened": "listed the unfinished uploads",
    "recording.inspected": "had the recorded files read",
    "recording.mapped": "said which sensor is worn where",
    "analyses.opened": "listed the analyses",
    "analysis.opened": "opened an analysis",
    "analysis.file_opened": "downloaded a file of an analysis",
    "analysis.requested": "asked for an analysis",
    "report.opened": "read the report",
    "assessment.written": "wrote the assessment on the report",
    "signed_report.signed": "signed the report",
    "signed_report.reopened": "reopened the signed report",
    "signed_report.opened": "read the signed report",
    "signed_reports.opened": "listed the signed reports",
    "leaflet.opened": "opened the leaflet for the patient",
    "course.opened": "opened the report over the visits",
    "report_link.made": "made a link to the signed report",
    "report_link.revoked": "revoked a link to the signed report",
    "report_link.refused": "opened an address that leads to no report",
    "report_link.opened": "read the signed report by a link",
    "study.exported": "took the numbers of the visit along in the tables of a study",
    "archive.opened": "downloaded the archive of a visit",
    "numbers.opened": "looked at the values",
    "parameter.opened": "looked at the strides behind a value",
    "signals.opened": "looked at the signals",
    "replay.opened": "looked at the figure",
    "review.opened": "looked at the changes by hand",
    "events.opened": "looked at the events",
    "strides.opened": "looked at the strides",
    "event.moved": "moved an event",
    "event.added": "added an event",
    "event.deleted": "deleted an event",
    "stride.left_out": "left a stride out",
    "stride.counted": "let a stride count",
    "edit.undone": "undid the last change by hand",
    "edit.redone": "redid the last undone change by hand",
    "filters.requested": "asked for a comparison of filters",
    "filter_runs.opened": "listed the comparisons of filters",
    "filter_run.opened": "opened a comparison of filters",
    "filter_run.file_opened": "downloaded a file of a comparison of filters",
    "references.opened": "listed the reference files",
    "reference.opened": "downloaded a reference file",
    "reference.added": "added a reference file",
    "reference.removed": "removed a reference file",
    "video.added": "set a video beside the take, and said that the person agreed",
    "video.begun": "began to film a take, and said that the person agreed",
    "video.discarded": "discarded the film of a take that came to nothing",
    "video.aligned": "aligned the video with the take",
    "video.removed": "removed the video",
    "video.opened": "looked at the video",
    "export.requested": "asked for a file for another program",
    "exports.opened": "listed the files for other programs",
    "sensitivity.requested": "asked how angles depend on the set-up",
    "sensitivities.opened": "listed the studies of the set-up",
    "sensitivity.opened": "opened a study of the set-up",
    "tuning.requested": "asked for a filter to be tuned",
    "tunings.opened": "listed the tunings of filters",
    "tuning.opened": "opened the tuning of a filter",
    "prescription.written": "prescribed feedback",
    "prescription.ended": "ended the prescription of feedback",
    "prescriptions.opened": "listed the prescriptions",
    "targets.opened": "looked at targets for feedback",
    "feedback.opened": "looked at what feedback did",
    "programme.started": "planned a programme",
    "programme.ended": "ended the programme",
    "programme.visit_changed": "changed a visit of the programme",
    "programmes.opened": "looked at the programme",
    "live.opened": "opened a live take",
    "live.code_given": "asked for a new code for the tablet",
    "live.paired": "paired a tablet",
    "live.watched": "watched the live take",
    "live.events_opened": "looked at the marks of the live take",
    "live.adopted": "found a live take again after a restart",
    "live.finished": "ended a live take",
    "live.closed": "closed a live take",
    "job.listed": "looked at the list of jobs",
    "job.opened": "looked at a job",
    "job.cancelled": "cancelled a job",
    "backup.made": "made a backup of everything",
    "backup.restored": "put a backup back",
    "database.accepted": "accepted this database as the clinic's own",
}
"""Action → what was done, to follow the name of who did it."""

SIGNED_IN_BY: Final[Mapping[str, str]] = {
    "password": "signed in by the password alone",
    "code": "signed in by the password and a code",
    "recovery_code": "signed in by the password and a recovery code",
    "security_key": "signed in by the password and a security key",
}
"""Factor of a sign-in (`accounts.Factor`) → what was done; rows from before say none."""

NOBODY: Final = "The system"
STRANGER: Final = "Somebody"
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
