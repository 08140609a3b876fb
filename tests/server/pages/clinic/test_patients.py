"""Patient list: speed and change of the latest visit, live trials, search."""

from __future__ import annotations

import datetime as dt
import json
import re

import pytest
from sqlalchemy import update

from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Role
from sagittal.server.clinic import patients, programmes, sessions
from sagittal.server.live_takes import live
from sagittal.server.pages.clinic.patients import FILTERS, list_patients
from sagittal.server.storage.schema.live_tables import live_take
from sagittal.server.storage.schema.tables import now
from sagittal.server.uploads import receiving
from tests.helpers.clinic import Clinic
from tests.server import analysed
from tests.server.pages.results.test_patient import API, rows_of, text_of, walked

pytestmark = pytest.mark.anyio


async def test_the_list_says_speed_change_and_what_to_look_at(clinic: Clinic) -> None:
    await walked(
        clinic, "V-3", [("2026-03-02", 0.60, {}), ("2026-04-06", 0.90, {}), ("2026-04-06", 1.00, {})]
    )
    await walked(clinic, "V-4", [("2026-03-02", 0.80, {}), ("2026-04-06", 1.30, {"feedback": True})])
    html = await text_of(clinic, "/patients")
    rows = {row.split()[0]: row for row in rows_of(html)}
    assert re.search(r"0\.95 \+0\.35 changed", rows["V-3"])
    assert re.search(r"0\.80 first in this condition", rows["V-4"]), "a training with feedback is no speed"
    assert re.search(r'data-show="".*?All <span class="dim num">\d+', html, re.DOTALL)
    hidden = await text_of(clinic, "/patients", "assistant")
    assert "0.95" not in hidden
    assert "Since the previous visit" not in hidden


async def test_lists_show_a_live_take_from_its_code_to_its_end(clinic: Clinic) -> None:
    async with clinic.client("clinician") as client:
        patient = (await client.post(f"{API}/patients", json={"code": "V-LIVE"})).json()["id"]
        body = {"title": "Training", "performed_on": "2026-11-28"}
        session = (await client.post(f"{API}/patients/{patient}/sessions", json=body)).json()["id"]

    async def states() -> list[str]:
        (in_list,) = [r for r in rows_of(await text_of(clinic, "/patients")) if r.startswith("V-LIVE")]
        (of_visit,) = rows_of(await text_of(clinic, f"/patients/{patient}"))
        words = ("No recording yet", "Waiting for the tablet", "Live now")
        return [w for row in (in_list, of_visit) for w in words if row.endswith(w)]

    assert await states() == ["No recording yet"] * 2
    with clinic.db.write() as c:
        take, code = live.open_take(c, None, session)
    assert await states() == ["Waiting for the tablet"] * 2
    assert "Waiting for the tablet" in await text_of(clinic, f"/sessions/{session}")
    with clinic.db.write() as c:
        c.execute(update(live_take).values(code_expires_at=now() - dt.timedelta(seconds=1)))
    assert await states() == ["No recording yet"] * 2
    with clinic.db.write() as c:
        c.execute(update(live_take).values(code_expires_at=now() + dt.timedelta(minutes=1)))
        live.pair(c, code)
    assert await states() == ["Waiting for the tablet"] * 2
    with clinic.db.write() as c:
        live.note_start(c, take.id, "replay")
    assert await states() == ["Live now"] * 2
    assert f'href="/sessions/{session}/live"' in await text_of(clinic, "/patients", "clinician")
    assert f'href="/sessions/{session}/live"' not in await text_of(clinic, "/patients", "viewer")
    with clinic.db.write() as c:
        live.end(c, None, take.id, "closed", count=0)
    assert await states() == ["No recording yet"] * 2


async def test_a_row_says_what_it_is_looked_for_by(clinic: Clinic) -> None:
    today = now().date()
    with clinic.db.write() as c:
        place, planned, nobody = (patients.create(c, None, code=f"K-{k}").id for k in range(3))
        visit = sessions.create(c, None, place, performed_on=today).id
        programmes.start(c, None, planned, starts_on=today)

    def kinds(*, results: bool = True) -> dict[str, set[str]]:
        identity = Identity(clinic.user("viewer"), "viewer", "", Role.VIEWER, "")
        with clinic.db.read() as c:
            result = patients.list_patients(c, identity, search="K-")
            rows = list_patients(c, clinic.app.state.reviewed, result, results=results)
        return {row["id"]: set(row["kinds"]) for row in rows}

    assert kinds() == {place: {"today"}, planned: {"programme"}, nobody: set()}
    state = clinic.app.state
    with receiving.receive(clinic.db, state.blobs, clinic.settings, None, visit, "walk.txt") as upload:
        upload.write(b"x")
        upload.keep()
    assert kinds()[place] == {"today", "check"}, "sensors are to be checked"
    files = dict(analysed.files())
    poor = json.loads(files["analysis.json"]) | {"parameters": []}
    analysed.finish(clinic, place, visit, files | {"analysis.json": json.dumps(poor).encode()})
    assert kinds()[place] == {"today", "check"}, "no strides"
    assert kinds(results=False)[place] == {"today"}
    assert {key for key, _ in FILTERS if key} == {"today", "check", "programme"}
