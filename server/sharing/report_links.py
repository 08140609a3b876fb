"""Links that give readers without an account access to one signed report; they expire and can be revoked.

Knowing the URL is sufficient, so it contains a random 256-bit token that is shown only once. The database
stores and indexes its hash, so the duration of a look-up reveals nothing about the token. The linked report
shows a number instead of the patient's code. Reopening a report ends its links. They also end when their
creator's account is closed or loses access to the report (`end_orphaned`); restrictions that depend on time,
such as emergency access, are checked whenever a link is opened.
"""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from typing import Final

from sqlalchemy import ColumnElement, Connection, insert, select, update

from sagittal.core.message import Message
from sagittal.server import audit
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import POLICY, Action
from sagittal.server.auth.sight import find_emergency, sees_patient
from sagittal.server.auth.tokens import new_token, token_hash
from sagittal.server.clinic import sessions
from sagittal.server.errors import Conflict, NotFound, ServiceError
from sagittal.server.sharing import signed_reports
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.report_tables import report_link, signed_report
from sagittal.server.storage.schema.tables import new_id, now, session, user

MOST_DAYS: Final = 90
USUAL_DAYS: Final = 14
QUIET: Final = dt.timedelta(minutes=1)
"""Openings of a link within this time count as one."""


@dataclass(frozen=True)
class ReportLink:
    """A link as shown to users, without its URL.

    Parameters
    ----------
    openings, opened_at : number of openings, and time of the last.
    emergency_id : emergency access in which it was created and with which it ends; None = none.
    """

    id: str
    report_id: str
    made_by: str | None
    made_at: dt.datetime
    expires_at: dt.datetime
    revoked_at: dt.datetime | None
    openings: int
    opened_at: dt.datetime | None
    emergency_id: str | None

    @property
    def is_open(self) -> bool:
        """Whether the link is valid."""
        return self.revoked_at is None and self.expires_at > now()


class LinkNotFound(ServiceError):  # noqa: N818 - as NotFound
    """No report for this URL: unknown, expired or revoked, without distinction."""

    status = 404

    def __init__(self) -> None:
        super().__init__(
            "link_not_valid",
            "This link is no longer valid. Ask the clinic for a new one.",
        )


def make(
    c: Connection, actor: Identity | None, report_id: str, days: int, name: str
) -> tuple[ReportLink, str]:
    """Create a link and return its token, which is not stored; it ends with an emergency access.

    Raises
    ------
    NotFound
        the report. ServiceError: bad_value. Conflict: not_in_force, if the report was reopened.
    """
    report = signed_reports.get(c, report_id)
    if not report.in_force:
        raise Conflict(
            "not_in_force",
            Message("Version {number} was reopened. Share the signed version.", number=report.number),
        )
    if not 1 <= days <= MOST_DAYS:
        raise ServiceError(
            "bad_value",
            Message(
                "A link is valid for {days} days; expected 1 to {MOST_DAYS}.", days=days, MOST_DAYS=MOST_DAYS
            ),
        )
    token, link_id, time = new_token(), new_id(), now()
    expires_at = time + dt.timedelta(days=days)
    patient_id = sessions.get(c, report.session_id).patient_id
    emergency = find_emergency(c, actor, patient_id)
    if emergency is not None:
        expires_at = min(expires_at, emergency.ends_at)
    c.execute(
        insert(report_link).values(
            id=link_id,
            report_id=report_id,
            token_sha256=token_hash(token),
            made_by=name,
            maker_id=None if actor is None else actor.user_id,
            made_at=time,
            expires_at=expires_at,
            openings=0,
            emergency_id=None if emergency is None else emergency.id,
        )
    )
    detail = {"report_id": report_id, "link_id": link_id, "days": days}
    if emergency is not None:
        detail["access"] = emergency.id
    audit.record(c, actor, "report_link.made", "session", report.session_id, detail)
    return get(c, link_id), token


def revoke(c: Connection, actor: audit.Actor | None, link_id: str, because: str | None = None) -> ReportLink:
    """End a link; no effect if it has ended. Raises NotFound.

    Parameters
    ----------
    because : reason for the audit log, None = revoked by a user.
    """
    link = get(c, link_id)
    if link.revoked_at is None:
        c.execute(update(report_link).where(report_link.c.id == link_id).values(revoked_at=now()))
        session_id = signed_reports.get(c, link.report_id).session_id
        detail = {"report_id": link.report_id, "link_id": link_id}
        if because is not None:
            detail["because"] = because
        audit.record(c, actor, "report_link.revoked", "session", session_id, detail)
    return get(c, link_id)


def end_of_emergency(c: Connection, actor: audit.Actor | None, access_id: str) -> None:
    """End the links created during an emergency access."""
    query = select(report_link.c.id).where(
        report_link.c.emergency_id == access_id, report_link.c.revoked_at.is_(None)
    )
    for link_id in c.execute(query).scalars().all():
        revoke(c, actor, link_id)


def list_orphaned(c: Connection) -> list[str]:
    """Ids of open links whose creator's account is closed or may no longer read the report."""
    query = _WITH_MAKER.where(report_link.c.revoked_at.is_(None), report_link.c.expires_at > now())
    return list(c.execute(query.where(~_may_share())).scalars())


def end_orphaned(c: Connection, actor: audit.Actor | None) -> None:
    """End orphaned links; call in every transaction that restricts an account's access to patients."""
    for link_id in list_orphaned(c):
        revoke(c, actor, link_id, because="maker_left")


def reopen_report(
    c: Connection, actor: audit.Actor | None, report_id: str, reason: str, name: str
) -> signed_reports.SignedReport:
    """Reopen a signed report and end its links; raises like `signed_reports.reopen`."""
    report = signed_reports.reopen(c, actor, report_id, reason, name)
    for link in of_session(c, report.session_id):
        if link.report_id == report_id and link.is_open:
            revoke(c, actor, link.id)
    return report


def find_by_token(c: Connection, token: str) -> ReportLink:
    """The valid link with this token; raises LinkNotFound."""
    row = c.execute(select(*_COLUMNS).where(report_link.c.token_sha256 == token_hash(token))).first()
    link = None if row is None else ReportLink(**row._asdict())
    if link is None or not link.is_open:
        raise LinkNotFound
    if c.execute(_WITH_MAKER.where(report_link.c.id == link.id, ~_may_share())).first():
        raise LinkNotFound
    return link


def note_opening(db: Database, link: ReportLink, address: str) -> None:
    """Count and record the opening of a link, at most once a minute to limit the audit log."""
    if link.opened_at is not None and now() - link.opened_at < QUIET:
        return
    with db.write() as c:
        session_id = signed_reports.get(c, link.report_id).session_id
        c.execute(
            update(report_link)
            .where(report_link.c.id == link.id)
            .values(openings=report_link.c.openings + 1, opened_at=now())
        )
        detail = {"report_id": link.report_id, "link_id": link.id, "address": address[:64]}
        audit.record(c, None, "report_link.opened", "session", session_id, detail)


def get(c: Connection, link_id: str) -> ReportLink:
    """One link; raises NotFound."""
    row = c.execute(select(*_COLUMNS).where(report_link.c.id == link_id)).first()
    if row is None:
        raise NotFound("link", link_id)
    return ReportLink(**row._asdict())


def of_session(c: Connection, session_id: str) -> list[ReportLink]:
    """Links to all versions of a session's report, newest first."""
    query = select(*_COLUMNS).join(signed_report).where(signed_report.c.session_id == session_id)
    rows = c.execute(query.order_by(report_link.c.made_at.desc()))
    return [ReportLink(**row._asdict()) for row in rows]


def _may_share() -> ColumnElement[bool]:
    """SQL condition for `_WITH_MAKER`: the creator of the link may currently read the report."""
    return user.c.active & user.c.role.in_(_READERS) & sees_patient(session.c.patient_id)


_COLUMNS = tuple(report_link.c[name] for name in ReportLink.__dataclass_fields__)
_READERS: Final = sorted(role.value for role in POLICY[Action.READ_RESULT])
_WITH_MAKER: Final = (
    select(report_link.c.id)
    .join(user, user.c.id == report_link.c.maker_id)
    .join(signed_report, signed_report.c.id == report_link.c.report_id)
    .join(session, session.c.id == signed_report.c.session_id)
)
"""Ids of links, joined with their creators and sessions."""
