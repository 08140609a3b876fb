"""Patient access rule, evaluated in the database."""

from __future__ import annotations

import datetime as dt

import pytest
from sqlalchemy import select, update

from sagittal.server.auth import sight
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Role
from sagittal.server.clinic import patients, sessions
from sagittal.server.sharing import care_teams
from sagittal.server.storage.schema.care_tables import emergency_access
from sagittal.server.storage.schema.tables import now, patient
from tests.helpers.clinic import Clinic
from tests.helpers.engines import on_both_engines

pytestmark = [pytest.mark.anyio, on_both_engines]


def person(clinic: Clinic, role: Role, name: str) -> Identity:
    return Identity(clinic.user(role.value, name), name, "", role, "")


async def test_outside_the_team_nothing_is_seen_but_in_an_emergency(clinic: Clinic) -> None:
    member, locum = (person(clinic, Role.CLINICIAN, name) for name in ("member", "locum"))
    admin = person(clinic, Role.ADMIN, "chief")
    everybody = (member, locum, admin)
    with clinic.db.write() as c:
        one = patients.create(c, None, code="SG-1").id
        visit = sessions.create(c, None, one).id
        care_teams.set_team(c, admin, one, [member.user_id])
    parts = {"sid": visit, "name": "stance_pct"}

    def seen() -> list[tuple[bool, bool]]:
        with clinic.db.read() as c:
            listed = [
                one in c.execute(sight.only_seen(select(patient.c.id), user)).scalars().all()
                for user in everybody
            ]
            return [
                (sight.may_open(c, user, parts), target)
                for user, target in zip(everybody, listed, strict=True)
            ]

    assert seen() == [(True, True)] * 3, "without care teams everybody sees everybody"
    with clinic.db.write() as c:
        care_teams.switch_on(c, admin, begin_with_past=False)
    assert seen() == [(True, True), (False, False), (True, True)]
    with clinic.db.read() as c:
        assert sight.list_hidden(c, locum.user_id, parts) == [one]
        assert sight.list_hidden(c, member.user_id, parts) == []
        assert sight.find_emergency(c, locum, one) is None
        assert one in c.execute(sight.only_seen(select(patient.c.id), None)).scalars().all()
        for nothing in ({"sid": "0" * 32}, {"sid": visit, "pid": "0" * 32}):
            assert not sight.may_open(c, member, nothing)
        assert sight.may_open(c, locum, {"name": "x"})
    with clinic.db.write() as c:
        access = care_teams.open_in_emergency(c, locum, "SG-1", "Fell in the corridor.")
    assert seen() == [(True, True)] * 3
    with clinic.db.read() as c:
        emergency = sight.find_emergency(c, locum, one)
        assert emergency is not None
        assert emergency.id == access.id
        assert [sight.find_emergency(c, user, one) for user in (member, admin, None)] == [None] * 3
    with clinic.db.write() as c:
        over = now() - dt.timedelta(seconds=1)
        c.execute(update(emergency_access).values(opened_at=over - dt.timedelta(hours=1), ends_at=over))
    assert seen() == [(True, True), (False, False), (True, True)]
    with clinic.db.write() as c:
        care_teams.switch_off(c, admin)
    assert seen() == [(True, True)] * 3


def test_every_part_of_an_address_belongs_to_a_patient_or_to_nobody() -> None:
    assert not sight.OWNER.keys() & sight.OF_NOBODY
    for query, own in sight.OWNER.values():
        assert query.selected_columns[0].name == "patient_id"
        assert own.name == "id"
