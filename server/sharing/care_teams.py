"""Care teams of patients, and emergency access from outside a team.

Disabled until an administrator enables them; for their effect see server/auth/sight.py.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, Final
from unicodedata import normalize

from sqlalchemy import Connection, Row, Select, case, delete, exists, insert, select, union, update

from sagittal.core.message import Message
from sagittal.core.plurals import plural
from sagittal.server import audit
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Role
from sagittal.server.auth.sight import CARE_TEAMS, TEAMS_ARE_ON, is_emergency_open, may_open
from sagittal.server.clinic import patients
from sagittal.server.errors import Conflict, NotAllowed, NotFound, ServiceError
from sagittal.server.sharing import report_links
from sagittal.server.storage.schema.care_tables import care_team_member, clinic_option, emergency_access
from sagittal.server.storage.schema.tables import audit as audit_table
from sagittal.server.storage.schema.tables import new_id, now, patient, session, user

EMERGENCY: Final = dt.timedelta(hours=4)
"""Duration of emergency access (our choice)."""
SHOWN: Final = dt.timedelta(days=90)
"""How long the patient's page shows it; the audit log retains it."""
REASON: Final = (10, 500)
"""Minimum and maximum length of a reason."""
_NOT_OF_A_TEAM: Final = (
    "emergency.opened",
    "emergency.ended",
    "patient.code_refused",
    "patient.hidden",
    "study.exported",
)
"""Audit actions that do not make a user a team member: access from outside, or studies over many visits."""


@dataclass(frozen=True)
class TeamMember:
    """An actual or possible member of a team."""

    user_id: str
    name: str
    role: Role


@dataclass(frozen=True)
class EmergencyAccess:
    """Emergency access from outside the team: user (name, account), reason and period.

    Parameters
    ----------
    ended_at : time of an early end. is_open : in effect at the time of reading.
    """

    id: str
    patient_id: str
    by: str
    by_id: str
    reason: str
    opened_at: dt.datetime
    ends_at: dt.datetime
    ended_at: dt.datetime | None
    is_open: bool


def are_on(c: Connection) -> bool:
    """Whether the clinic has care teams."""
    return bool(c.execute(select(TEAMS_ARE_ON)).scalar_one())


def switch_on(c: Connection, actor: audit.Actor, *, begin_with_past: bool) -> None:
    """Restrict each patient to its care team; no effect if already enabled.

    Links to reports end if their creator is not in the team.

    Parameters
    ----------
    begin_with_past : users who have accessed or changed a patient's data join the team; existing teams are
        unchanged.
    """
    if are_on(c):
        return
    time = now()
    rows = _list_past(c) if begin_with_past else []
    if rows:
        c.execute(insert(care_team_member), [{"patient_id": p, "user_id": u, "since": time} for p, u in rows])
    c.execute(insert(clinic_option).values(name=CARE_TEAMS, since=time))
    audit.record(c, actor, "care_teams.on", "clinic", None, {"members": len(rows)})
    report_links.end_orphaned(c, actor)


def switch_off(c: Connection, actor: audit.Actor) -> None:
    """Give all users access to all patients; the teams are retained."""
    if c.execute(delete(clinic_option).where(clinic_option.c.name == CARE_TEAMS)).rowcount:
        audit.record(c, actor, "care_teams.off", "clinic", None)


def list_people(c: Connection, patient_id: str) -> list[tuple[TeamMember, bool]]:
    """Possible and actual members of a patient's team, by name.

    Active accounts can be members, except administrators, who have access to all patients.
    """
    mine = (care_team_member.c.user_id == user.c.id) & (care_team_member.c.patient_id == patient_id)
    can = user.c.active & (user.c.role != Role.ADMIN)
    query = (
        select(user, care_team_member.c.since)
        .outerjoin(care_team_member, mine)
        .where(can | care_team_member.c.since.is_not(None))
        .order_by(user.c.name)
    )
    return [
        (TeamMember(row.id, row.display_name or row.name, Role(row.role)), row.since is not None)
        for row in c.execute(query)
    ]


def list_team(c: Connection, patient_id: str) -> list[TeamMember]:
    """Care team of a patient, by name."""
    return [one for one, is_in in list_people(c, patient_id) if is_in]


def set_team(
    c: Connection, actor: audit.Actor, patient_id: str, user_ids: Collection[str]
) -> list[TeamMember]:
    """Set the care team of a patient and end the report links of those who leave it.

    Raises
    ------
    NotFound
        the patient does not exist, or an id belongs to no active account.
    """
    patients.get(c, patient_id)
    members = set(user_ids)
    membership = {one.user_id: is_in for one, is_in in list_people(c, patient_id)}
    previous = {user_id for user_id, is_in in membership.items() if is_in}
    unknown = members - membership.keys()
    if unknown:
        raise NotFound("account for a team", min(unknown))
    gone = care_team_member.c.user_id.in_(previous - members)
    c.execute(delete(care_team_member).where(care_team_member.c.patient_id == patient_id, gone))
    for user_id in sorted(members - previous):
        c.execute(insert(care_team_member).values(patient_id=patient_id, user_id=user_id, since=now()))
    if members != previous:
        detail = {"added": sorted(members - previous), "removed": sorted(previous - members)}
        audit.record(c, actor, "care_team.changed", "patient", patient_id, detail)
        report_links.end_orphaned(c, actor)
    return list_team(c, patient_id)


def add_maker(c: Connection, user: Identity, patient_id: str) -> None:
    """Add the user who creates a patient to its team; otherwise only administrators would have access."""
    if user.role is not Role.ADMIN and are_on(c):
        c.execute(insert(care_team_member).values(patient_id=patient_id, user_id=user.user_id, since=now()))
        audit.record(
            c, user, "care_team.changed", "patient", patient_id, {"added": [user.user_id], "removed": []}
        )


def open_in_emergency(c: Connection, user: Identity, code: str, reason: str) -> EmergencyAccess:
    """Give a user outside the team temporary access to a patient.

    Requires the exact code, so that it cannot be used to search for patients.

    Raises
    ------
    NotFound : no patient has exactly this code. ServiceError bad_value : the reason is too short or too long.
    Conflict : care_teams_off, seen_already.
    """
    if not are_on(c):
        raise Conflict(
            "care_teams_off", "This clinic does not use care teams: all patients are in your list."
        )
    text = " ".join(reason.split())
    if not REASON[0] <= len(text) <= REASON[1]:
        raise ServiceError(
            "bad_value",
            Message(
                f"The reason has {{text}} {plural(len(text), 'character', 'characters')}. Expected "
                "{REASON} to {REASON2}.",
                text=len(text),
                REASON=REASON[0],
                REASON2=REASON[1],
            ),
        )
    normalized = normalize("NFKC", code).strip()
    patient_id = c.execute(select(patient.c.id).where(patient.c.code == normalized)).scalar()
    if patient_id is None:
        raise NotFound("patient", normalized)
    if may_open(c, user, {"patient_id": patient_id}):
        raise Conflict("seen_already", "You already have access to this patient; see the patient list.")
    time = now()
    row = {
        "id": new_id(),
        "patient_id": patient_id,
        "reason": text,
        "opened_at": time,
        "ends_at": time + EMERGENCY,
    }
    c.execute(insert(emergency_access).values(**row, user_id=user.user_id))
    # the reason is stored with the patient and deleted with it; the audit row remains
    detail = {"access": row["id"], "hours": EMERGENCY / dt.timedelta(hours=1)}
    audit.record(c, user, "emergency.opened", "patient", patient_id, detail)
    return _get_access(c, row["id"])


def may_end(access: EmergencyAccess, user: Identity) -> bool:
    """Whether a user may end an access: its owner or an administrator."""
    return user.is_admin or access.by_id == user.user_id


def end_emergency(c: Connection, user: Identity, access_id: str) -> EmergencyAccess:
    """End an emergency access and the links that depend on it; no effect if it has ended.

    Raises
    ------
    NotFound; NotAllowed `not_yours` for another user's access.
    """
    access = _get_access(c, access_id)
    if not may_end(access, user):
        raise NotAllowed(
            "not_yours",
            Message("{by} opened this patient. Ask that person or an administrator to end it.", by=access.by),
        )
    if access.is_open:
        mine = emergency_access.c.id == access_id
        c.execute(update(emergency_access).where(mine).values(ended_at=now()))
        report_links.end_of_emergency(c, user, access_id)
        report_links.end_orphaned(c, user)
        audit.record(c, user, "emergency.ended", "patient", access.patient_id, {"access": access_id})
    return _get_access(c, access_id)


def end_all_emergencies(c: Connection) -> None:
    """End all emergency accesses after a restore, since later changes to them are unknown."""
    # including ended ones: the clock of this computer may be ahead
    unended = update(emergency_access).where(emergency_access.c.ended_at.is_(None))
    over = case((is_emergency_open(), now()), else_=emergency_access.c.ends_at)
    c.execute(unended.values(ended_at=over))


def list_accesses(c: Connection, patient_id: str) -> list[EmergencyAccess]:
    """Recent emergency accesses to a patient, newest first."""
    of_late = (emergency_access.c.patient_id == patient_id) & (emergency_access.c.opened_at > now() - SHOWN)
    query = _select_accesses().where(of_late).order_by(emergency_access.c.opened_at.desc())
    return [_make_access(row) for row in c.execute(query)]


def _select_accesses() -> Select[Any]:
    columns = (emergency_access, is_emergency_open().label("is_open"), user.c.name, user.c.display_name)
    return select(*columns).join(user, user.c.id == emergency_access.c.user_id)


def _get_access(c: Connection, access_id: str) -> EmergencyAccess:
    row = c.execute(_select_accesses().where(emergency_access.c.id == access_id)).first()
    if row is None:
        raise NotFound("emergency access", access_id)
    return _make_access(row)


def _make_access(row: Row[Any]) -> EmergencyAccess:
    return EmergencyAccess(
        row.id,
        row.patient_id,
        row.display_name or row.name,
        row.user_id,
        row.reason,
        row.opened_at,
        row.ends_at,
        row.ended_at,
        row.is_open,
    )


def _list_past(c: Connection) -> list[tuple[str, str]]:
    """Pairs of patient and user with earlier access or changes, for existing accounts.

    Omits patients with an existing team, and users with emergency access to the patient.
    """
    is_work = audit_table.c.action.not_in(_NOT_OF_A_TEAM)
    of_patient = select(patient.c.id.label("patient_id"), audit_table.c.user_id).join(
        audit_table, (audit_table.c.resource == "patient") & (audit_table.c.resource_id == patient.c.id)
    )
    of_session = (
        select(session.c.patient_id, audit_table.c.user_id)
        .select_from(session)
        .join(
            audit_table, (audit_table.c.resource == "session") & (audit_table.c.resource_id == session.c.id)
        )
    )
    done = union(of_patient.where(is_work), of_session.where(is_work)).subquery()
    colleagues = (user.c.id == done.c.user_id) & user.c.active & (user.c.role != Role.ADMIN)
    with_team = union(
        select(care_team_member.c.patient_id),
        select(audit_table.c.resource_id).where(audit_table.c.action == "care_team.changed"),
    )
    came = (emergency_access.c.patient_id == done.c.patient_id) & (
        emergency_access.c.user_id == done.c.user_id
    )
    query = (
        select(done).join(user, colleagues).where(done.c.patient_id.not_in(with_team), ~exists().where(came))
    )
    return [(row[0], row[1]) for row in c.execute(query)]
