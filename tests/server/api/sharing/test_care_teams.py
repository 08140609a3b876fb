"""Care teams over time: who is in one at the beginning, and whoever guesses codes from outside."""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Any

import httpx
import pytest
from alembic import command
from sqlalchemy import select, update

from sagittal.server import audit
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Role
from sagittal.server.auth.throttle import MAX_PER_ADDRESS, MAX_PER_PAIR, Throttle
from sagittal.server.sharing import report_links, signed_reports
from sagittal.server.sharing.care_teams import EMERGENCY, end_all_emergencies
from sagittal.server.sharing.signed_reports import DOCUMENT, PSEUDONYMISED
from sagittal.server.storage.migrate import configuration
from sagittal.server.storage.schema.care_tables import emergency_access
from sagittal.server.storage.schema.tables import new_id, now, user
from sagittal.server.storage.schema.tables import patient as patient_table
from tests.helpers.clinic import PASSWORD, Clinic, open_clinic

pytestmark = pytest.mark.anyio

API = "/api/v1"
LONG_AGO = dt.datetime(2024, 1, 1, tzinfo=dt.UTC)


async def switch(clinic: Clinic, *, on: bool, **more: bool) -> None:
    async with clinic.client("admin") as client:
        answer = await client.put(f"{API}/care-teams", json={"on": on} | more)
        assert answer.json() == {"on": on}


async def add(clinic: Clinic, code: str) -> str:
    """Id of a new patient, added by an administrator, who is in no team."""
    async with clinic.client("admin") as client:
        response = await client.post(f"{API}/patients", json={"code": code})
        assert response.status_code == 201, response.text
        return str(response.json()["id"])


async def team(clinic: Clinic, patient: str) -> set[str]:
    async with clinic.client("admin") as client:
        body = (await client.get(f"{API}/patients/{patient}/care-team")).json()
    return {member["name"] for member in body["members"]}


async def enter(clinic: Clinic, role: str, patient: str) -> int:
    """Open a patient; the status of the answer."""
    async with clinic.client(role) as client:
        return (await client.get(f"{API}/patients/{patient}")).status_code


async def ask_in_emergency(clinic: Clinic, code: str, name: str = "clinician") -> int:
    """Ask as a clinician for a patient by the code; the status of the answer."""
    clinic.user("clinician", name)
    async with clinic.client(name) as client:
        body = {"code": code, "reason": "Fell in the corridor."}
        return (await client.post(f"{API}/emergency-accesses", json=body)).status_code


async def test_care_teams_begin_with_whoever_has_worked_with_the_patient(clinic: Clinic) -> None:
    patient = await add(clinic, "Alder")
    async with clinic.client("admin") as client:
        visit = (await client.post(f"{API}/patients/{patient}/sessions", json={"title": "Walk"})).json()["id"]
    async with clinic.client("assistant") as client:
        assert (await client.get(f"{API}/sessions/{visit}")).status_code == 200
    identity = Identity(clinic.user("viewer"), "viewer", "", Role.VIEWER, "")
    with clinic.db.write() as c:  # the row that the tables of a study leave of each visit
        audit.record(c, identity, "study.exported", "session", visit, {"visits": 1})
    await switch(clinic, on=True, begin_with_past=True)
    assert await team(clinic, patient) == {"assistant"}
    async with clinic.client("admin") as client:
        for one in (clinic.user("admin"), "0" * 32):  # an administrator sees everybody anyhow
            refused = await client.put(f"{API}/patients/{patient}/care-team", json={"users": [one]})
            assert refused.status_code == 404
    await switch(clinic, on=False)
    assert await enter(clinic, "viewer", patient) == 200


async def test_trying_a_patient_of_another_team_is_a_row_and_no_way_into_it(clinic: Clinic) -> None:
    hidden = await add(clinic, "Larch")
    await switch(clinic, on=True)
    for _ in range(2):  # each time with a sign-in of its own
        assert await enter(clinic, "viewer", hidden) == await enter(clinic, "viewer", "0" * 32) == 404
    async with clinic.client("admin") as client:
        rows = (await client.get(f"{API}/audit")).json()
        assert "tried to open the patient, from outside the care team" in (await client.get("/audit")).text
    place = [r for r in rows if r["resource_id"] in {hidden, "0" * 32}]
    tried = [(r["user_name"], r["resource_id"]) for r in place if r["action"] == "patient.hidden"]
    assert tried == [("viewer", hidden)]
    await switch(clinic, on=False)
    await switch(clinic, on=True, begin_with_past=True)
    assert await team(clinic, hidden) == set()
    await switch(clinic, on=False)


@pytest.mark.slow
async def test_switching_care_teams_off_and_on_puts_nobody_back_or_in(clinic: Clinic) -> None:
    """A team that was set stays; whoever came in an emergency is in no team for that."""
    of_one, of_nobody, new = [await add(clinic, code) for code in ("Elm", "Fir", "Hazel")]
    for role in ("assistant", "viewer"):
        assert await enter(clinic, role, of_one) == await enter(clinic, role, of_nobody) == 200
    await switch(clinic, on=True, begin_with_past=True)
    async with clinic.client("admin") as client:
        for patient, left in ((of_one, ["viewer"]), (of_nobody, [])):
            to = f"{API}/patients/{patient}/care-team"
            users = {"users": [clinic.user(name) for name in left]}
            assert (await client.put(to, json=users)).status_code == 200
    for patient, code in ((of_one, "Elm"), (new, "Hazel")):
        assert await ask_in_emergency(clinic, code) == 201
        assert await enter(clinic, "clinician", patient) == 200  # looks around while it is open
    with clinic.db.write() as c:
        over = {"opened_at": dt.datetime(2024, 1, 1, tzinfo=dt.UTC), "ends_at": dt.datetime.now(dt.UTC)}
        c.execute(update(emergency_access).values(**over))
    await switch(clinic, on=False)
    assert await enter(clinic, "viewer", new) == 200
    await switch(clinic, on=True, begin_with_past=True)
    assert await team(clinic, of_one) == {"viewer"}
    assert await team(clinic, of_nobody) == set()
    assert await team(clinic, new) == {"viewer"}
    assert await enter(clinic, "clinician", new) == 404
    await switch(clinic, on=False)


async def open_in_emergency(clinic: Clinic, name: str, code: str) -> str:
    """Id of the access of a clinician."""
    assert await ask_in_emergency(clinic, code, name) == 201
    with clinic.db.read() as c:
        indices = select(emergency_access.c.id).join(user).join(patient_table)
        indices = indices.where(user.c.name == name, patient_table.c.code == code)
        return str(c.execute(indices.order_by(emergency_access.c.opened_at.desc())).scalars().first())


async def sign(clinic: Clinic, patient: str) -> str:
    """Id of a signed report of a visit of the patient."""
    async with clinic.client("admin") as client:
        visit = (await client.post(f"{API}/patients/{patient}/sessions", json={"title": "Walk"})).json()["id"]
    report, blobs = new_id(), clinic.app.state.blobs
    stored = {name: blobs.put(patient, b"<p>Signed</p>") for name in (DOCUMENT, PSEUDONYMISED)}
    with clinic.db.write() as c:
        signature = signed_reports.prepare_signature(c, visit, report, "Anna")
        signed_reports.keep_signed(c, None, signature, visit, new_id(), "en", stored)
    return report


async def share(clinic: Clinic, name: str, report: str) -> dict[str, Any]:
    async with clinic.client(name) as client:
        response = await client.post(f"{API}/signed-reports/{report}/links", json={"days": 90})
        assert response.status_code == 201, response.text
        return dict(response.json())


def leads(clinic: Clinic, result: dict[str, Any]) -> bool:
    with clinic.db.read() as c:
        try:
            return report_links.find_by_token(c, result["url"].rsplit("/", 1)[1]).is_open
        except report_links.LinkNotFound:
            return False


def is_revoked(clinic: Clinic, result: dict[str, Any]) -> bool:
    with clinic.db.read() as c:
        return report_links.get(c, result["link"]["id"]).revoked_at is not None


@pytest.mark.slow
@pytest.mark.parametrize("by", ["locum", "admin"])
async def test_an_emergency_ends_now_with_its_links(clinic: Clinic, by: str) -> None:
    clinic.app.state.throttle = Throttle()
    code = f"Maple-{by}"
    patient = await add(clinic, code)
    report = await sign(clinic, patient)
    await switch(clinic, on=True)
    clinic.user("clinician", "member")
    async with clinic.client("admin") as client:
        users = {"users": [clinic.user("member")]}
        await client.put(f"{API}/patients/{patient}/care-team", json=users)
    access = await open_in_emergency(clinic, "locum", code)
    ends = f"{API}/emergency-accesses/{access}/end"
    of_locum, of_member = await share(clinic, "locum", report), await share(clinic, "member", report)
    with clinic.db.read() as c:
        mine = emergency_access.c.id == access
        ends_at = c.execute(select(emergency_access.c.ends_at).where(mine)).scalar()
    assert dt.datetime.fromisoformat(of_locum["link"]["expires_at"]) == ends_at
    assert (of_locum["link"]["emergency_id"], of_member["link"]["emergency_id"]) == (access, None)
    assert leads(clinic, of_locum)
    clinic.user("clinician", "stranger")
    for name, status in (("viewer", 403), ("stranger", 404), ("member", 403)):
        async with clinic.client(name) as client:
            assert (await client.post(ends)).status_code == status, name
    assert await enter(clinic, "locum", patient) == 200
    for name, view in (("locum", True), ("admin", True), ("member", False)):
        async with clinic.client(name) as client:
            page = (await client.get(f"/patients/{patient}")).text
            assert "Emergency access by" in page
            # of whoever is in another zone: four hours on the clock of the wall would not be four
            assert " ".join(page.split()).count(" UTC") >= 3, "since, until, and until above"
            assert ("End now" in page) == view, name
    async with clinic.client(by) as client:
        ended = await client.post(ends)
        assert ended.status_code == 200, ended.text
        assert dt.datetime.fromisoformat(ended.json()["ended_at"]) <= now()
        assert not ended.json()["is_open"]
    assert await enter(clinic, "locum", patient) == 404
    assert not leads(clinic, of_locum)
    assert leads(clinic, of_member)
    async with clinic.client("admin") as client:
        assert (await client.post(ends)).json() == ended.json()  # it stays as it is
        rows = [r for r in (await client.get(f"{API}/audit")).json() if r["detail"].get("access") == access]
        assert "End now" not in (await client.get(f"/patients/{patient}")).text
    assert [r["action"] for r in rows] == ["emergency.ended", "report_link.made", "emergency.opened"]
    assert await ask_in_emergency(clinic, code, "locum") == 201  # and again, with a reason
    await switch(clinic, on=False)
    await switch(clinic, on=True, begin_with_past=True)
    assert await team(clinic, patient) == {"member"}
    await switch(clinic, on=False)


async def set_team(clinic: Clinic, patient: str, *names: str) -> None:
    async with clinic.client("admin") as client:
        users = {"users": [clinic.user("clinician", name) for name in names]}
        (await client.put(f"{API}/patients/{patient}/care-team", json=users)).raise_for_status()


async def close(clinic: Clinic, name: str) -> None:
    async with clinic.client("admin") as client:
        (
            await client.patch(f"{API}/users/{clinic.user('clinician', name)}", json={"active": False})
        ).raise_for_status()


@pytest.mark.parametrize("how", ["account", "team", "switch", "role"])
async def test_links_end_when_their_maker_leaves(clinic: Clinic, how: str) -> None:
    patient = await add(clinic, f"Rowan-{how}")
    report = await sign(clinic, patient)
    leaver, stayer = f"leaver-{how}", f"stayer-{how}"
    for name in (leaver, stayer):
        clinic.user("clinician", name)
    if how in {"team", "role"}:
        await switch(clinic, on=True)
        await set_team(clinic, patient, leaver, stayer)
    if how == "switch":
        await set_team(clinic, patient, stayer)
    if how == "role":
        await set_team(clinic, patient, stayer)
        async with clinic.client("admin") as client:
            (
                await client.patch(f"{API}/users/{clinic.user(leaver)}", json={"role": "admin"})
            ).raise_for_status()
    of_leaver, of_stayer = await share(clinic, leaver, report), await share(clinic, stayer, report)
    assert leads(clinic, of_leaver)
    if how == "account":
        await close(clinic, leaver)
    elif how == "team":
        await set_team(clinic, patient, stayer)
    elif how == "switch":
        await switch(clinic, on=True)
    else:
        async with clinic.client("admin") as client:
            user_id = clinic.user(leaver)
            (await client.patch(f"{API}/users/{user_id}", json={"role": "clinician"})).raise_for_status()
    assert not leads(clinic, of_leaver)
    assert leads(clinic, of_stayer)
    async with clinic.client("admin") as client:
        rows = (await client.get(f"{API}/audit")).json()
        ended = [row["detail"] for row in rows if row["action"] == "report_link.revoked"]
    link_id = of_leaver["link"]["id"]
    assert [d["because"] for d in ended if d["link_id"] == link_id] == ["maker_left"]
    await switch(clinic, on=False)


async def test_links_of_makers_who_had_left_before_an_upgrade_end_at_the_start(tmp_path: Path) -> None:
    async with open_clinic(tmp_path) as clinic:
        patient = await add(clinic, "Yew")
        clinic.user("clinician", "leaver")
        result = await share(clinic, "leaver", await sign(clinic, patient))
        with clinic.db.write() as c:
            c.execute(update(user).where(user.c.name == "leaver").values(active=False))
        assert not is_revoked(clinic, result)
        source = clinic.settings.database_source
    command.downgrade(configuration(source), "0021")  # which did not know the makers
    async with open_clinic(tmp_path) as clinic:
        assert is_revoked(clinic, result)
        assert not leads(clinic, result)


@pytest.mark.parametrize("how", ["ended", "by_the_clock", "role"])
async def test_a_link_of_a_member_ends_with_the_last_access_to_the_report(clinic: Clinic, how: str) -> None:
    """Who was in the team while an emergency went on made a link of no emergency, and left the team first."""
    clinic.app.state.throttle = Throttle()
    code, name = f"Larch-{how}", f"guest-{how}"
    patient = await add(clinic, code)
    report = await sign(clinic, patient)
    await switch(clinic, on=True)
    access = await open_in_emergency(clinic, name, code)
    await set_team(clinic, patient, name)
    result = await share(clinic, name, report)
    assert result["link"]["emergency_id"] is None
    if how != "role":
        await set_team(clinic, patient)
    assert leads(clinic, result), "the emergency goes on"
    if how == "ended":
        async with clinic.client(name) as client:
            (await client.post(f"{API}/emergency-accesses/{access}/end")).raise_for_status()
        assert is_revoked(clinic, result)
    elif how == "by_the_clock":
        with clinic.db.write() as c:
            mine = emergency_access.c.id == access
            c.execute(update(emergency_access).where(mine).values(ends_at=now()))
    else:
        async with clinic.client("admin") as client:
            to = f"{API}/users/{clinic.user(name)}"
            (await client.patch(to, json={"role": "assistant"})).raise_for_status()
        assert is_revoked(clinic, result)
    assert not leads(clinic, result)
    await switch(clinic, on=False)


async def test_an_access_that_ended_meanwhile_does_not_come_back_with_a_backup(clinic: Clinic) -> None:
    clinic.app.state.throttle = Throttle()
    patient = await add(clinic, "Willow")
    await switch(clinic, on=True)
    access = await open_in_emergency(clinic, "locum", "Willow")
    for hours in (-5, 0, 1):  # the clock went on, or back
        opened_at = now() + dt.timedelta(hours=hours)
        times = {"opened_at": opened_at, "ends_at": opened_at + EMERGENCY, "ended_at": None}
        with clinic.db.write() as c:
            mine = emergency_access.c.id == access
            c.execute(update(emergency_access).where(mine).values(**times))
            end_all_emergencies(c)
            ended_at = c.execute(select(emergency_access.c.ended_at).where(mine)).scalar_one()
        assert ended_at == times["ends_at"] if hours == -5 else now() - ended_at < dt.timedelta(minutes=1)
        assert await enter(clinic, "locum", patient) == 404
    await switch(clinic, on=False)


async def test_end_now_ends_it_though_the_clock_went_back(clinic: Clinic) -> None:
    clinic.app.state.throttle = Throttle()
    patient = await add(clinic, "Sallow")
    await switch(clinic, on=True)
    access = await open_in_emergency(clinic, "locum", "Sallow")
    later = now() + dt.timedelta(hours=1)
    with clinic.db.write() as c:
        mine = emergency_access.c.id == access
        c.execute(update(emergency_access).where(mine).values(opened_at=later, ends_at=later + EMERGENCY))
    assert await enter(clinic, "locum", patient) == 200
    async with clinic.client("locum") as client:
        assert (await client.post(f"{API}/emergency-accesses/{access}/end")).status_code == 200
    assert await enter(clinic, "locum", patient) == 404
    async with clinic.client("admin") as client:
        assert "End now" not in (await client.get(f"/patients/{patient}")).text
    await switch(clinic, on=False)


@pytest.fixture
def counted(clinic: Clinic) -> None:
    """Failures are counted from nought."""
    clinic.app.state.throttle = Throttle()


@pytest.mark.usefixtures("counted")
async def test_wrong_passwords_at_one_address_do_not_close_the_emergency_door(clinic: Clinic) -> None:
    await add(clinic, "Juniper")
    await switch(clinic, on=True)
    async with clinic.client() as client:
        for i in range(MAX_PER_ADDRESS + 1):
            wrong = await client.post(f"{API}/sign-in", json={"name": f"n{i}", "password": PASSWORD})
    assert wrong.status_code == 429
    assert await ask_in_emergency(clinic, "Juniper") == 201
    await switch(clinic, on=False)


@pytest.mark.usefixtures("counted")
async def test_guessed_codes_at_one_address_do_not_close_the_sign_in(clinic: Clinic) -> None:
    await switch(clinic, on=True)
    names = [f"guesser {i}" for i in range(MAX_PER_ADDRESS // MAX_PER_PAIR)]
    guessed = [await ask_in_emergency(clinic, "P-0", name) for name in names for _ in range(MAX_PER_PAIR)]
    assert set(guessed) == {404}
    assert await ask_in_emergency(clinic, "P-0", "guesser of the same address") == 429
    async with clinic.client() as client:
        signed = await client.post(f"{API}/sign-in", json={"name": names[0], "password": PASSWORD})
    assert signed.status_code == 200, signed.text
    await switch(clinic, on=False)


@pytest.mark.slow
@pytest.mark.usefixtures("counted")
@pytest.mark.parametrize("way", ["add", "change"])
async def test_a_refused_code_of_another_team_tells_no_spelling_and_is_counted(
    clinic: Clinic, way: str
) -> None:
    hidden, reference = await add(clinic, f"Rowan-{way}"), await add(clinic, f"Spruce-{way}")
    async with clinic.client("admin") as client:
        users = {"users": [clinic.user("clinician")]}
        assert (await client.put(f"{API}/patients/{reference}/care-team", json=users)).status_code == 200
    await switch(clinic, on=True)
    method, path = ("POST", "") if way == "add" else ("PATCH", f"/{reference}")

    async def give(code: str, role: str = "clinician") -> httpx.Response:
        async with clinic.client(role) as client:
            return await client.request(method, f"{API}/patients{path}", json={"code": code})

    if way == "add":  # of one's own team it is no guess
        assert [(await give(f"SPRUCE-{way}")).status_code for _ in range(MAX_PER_PAIR + 1)][-1] == 409
    typed = f"ROWAN-{way}"
    message = [await give(typed) for _ in range(MAX_PER_PAIR + 1)]
    assert [answer.status_code for answer in message] == [409] * MAX_PER_PAIR + [429]
    assert typed in message[0].text
    assert "Rowan" not in message[0].text
    assert (await give(typed, "admin")).status_code == 409
    assert await ask_in_emergency(clinic, f"Rowan-{way}") == 201  # this door stays open
    async with clinic.client("clinician") as client:
        noted = await client.patch(f"{API}/patients/{reference}", json={"note": "uses a stick"})
        assert noted.status_code == 200
    async with clinic.client("admin") as client:
        rows = (await client.get(f"{API}/audit")).json()
        assert "from outside the care team" in (await client.get("/audit")).text
    refused = [
        row for row in rows if row["action"] == "patient.code_refused" and row["resource_id"] == hidden
    ]
    assert [row["user_name"] for row in refused] == ["clinician"] * MAX_PER_PAIR
    await switch(clinic, on=False)
