"""How many SQL statements a page takes in a full clinic: a number that no patient and no visit raises."""

from __future__ import annotations

import datetime as dt
from collections.abc import AsyncIterator, Mapping
from pathlib import Path

import pytest
from fastapi.routing import APIRoute
from sqlalchemy import insert, select

from sagittal.core.feedback import Baseline, Cue
from sagittal.server.clinic import identities, patients, programmes, sessions
from sagittal.server.live_takes import live_events
from sagittal.server.pages.routes import ROUTERS
from sagittal.server.pages.shell import FRAGMENT
from sagittal.server.results import prescriptions
from sagittal.server.storage.schema.care_tables import care_team_member
from sagittal.server.storage.schema.live_tables import live_take
from sagittal.server.storage.schema.tables import analysis, new_id, recording
from tests.helpers.clinic import Clinic, open_clinic
from tests.server import analysed, crowd

pytestmark = pytest.mark.anyio

MOST = 20
MOST_OF_LIST = 10
"""Of the patients' list; who looks at it is written down too, but not each time."""
MANY = 30
"""Of everything that a page of the full clinic lists or looks through."""

PAGES = sorted(
    r.path
    for router in ROUTERS
    for r in router.routes
    if isinstance(r, APIRoute) and "GET" in (r.methods or ()) and not r.path.endswith(".pdf")
)
QUERIES = {"/patients/{pid}/compare": "?visit={sid}&visit={other}"}
ANSWERS = {
    "/": 303,
    "/patients/{pid}/compare": 303,
    "/r/{token}": 404,
    "/set-up/{token}": 404,
    "/texts/{language}/{version}.json": 404,
}
"""Where a page answers something else than itself."""

TRAINED = {
    "parameter": "stance_pct",
    "side": "left",
    "target": {"source": "manual", "mean": 64.0, "sd": 1.0},
    "schedule": {"kind": "every"},
}


@pytest.fixture(scope="module")
async def full(
    tmp_path_factory: pytest.TempPathFactory, anyio_backend: str
) -> AsyncIterator[tuple[Clinic, Mapping[str, str]]]:
    """Clinic with much of everything, and values for the address parameters."""
    async with open_clinic(tmp_path_factory.mktemp("full")) as clinic:
        results = analysed.files()
        identities.make_key(clinic.db, clinic.settings.identity_key_file)
        crowd.fill(clinic, MANY, 2, results, controls=True)
        ((*earlier, last),) = crowd.fill(clinic, 1, MANY, results)
        _train(clinic, earlier, last)
        for i in range(MANY):
            clinic.user("viewer", f"viewer-{i}")
        with clinic.db.read() as c:
            pid = sessions.get(c, last).patient_id
        async with clinic.client("admin") as client:
            report_id = (await client.post(f"/sessions/{last}/report/sign", json={})).json()["id"]
        yield (
            clinic,
            {
                "pid": pid,
                "sid": last,
                "other": earlier[-1],
                "name": "stance_pct",
                "report_id": report_id,
                "token": "x" * 43,
                "language": "en",
                "version": "none",
                "device_id": crowd.DEVICES[0],
            },
        )


def _train(clinic: Clinic, earlier: list[str], last: str) -> None:
    """A patient on many programmes with many prescriptions, empty visits and takes with cues."""
    cue = Cue(1, "left", 2.0, 3.0, 64.0, 0.0, "in", True, None, 0, 63.0, 65.0)
    with clinic.db.write() as c:
        response = sessions.get(c, last)
        for i in range(MANY):
            sessions.create(
                c, None, response.patient_id, performed_on=response.performed_on - dt.timedelta(days=1)
            )
            written = prescriptions.write(c, clinic.app.state.reviewed, None, response.patient_id, TRAINED)
            programmes.start(c, None, response.patient_id, starts_on=dt.date(1990 + i, 1, 4))
        took = c.execute(
            select(recording.c.id).join(analysis).where(recording.c.session_id == last)
        ).scalar_one()
        began = {
            "id": written.id,
            "prescription": written.content.to_json(),
            "baseline": Baseline().to_json(),
        }
        for sid in (*earlier, last):
            take = new_id()
            row = {"id": take, "session_id": sid, "state": "finished", "prescription_id": written.id}
            # what the earlier takes became is not what was analysed: each is looked at and passed over
            became = took if sid == last else None
            c.execute(
                insert(live_take).values(
                    **row,
                    recording_id=became,
                    created_at=response.created_at,
                    finished_at=response.created_at,
                )
            )
            live_events.add_event(c, None, take, "prescription", None, began)
            live_events.add_event(c, None, take, "cue", cue.t_s, {"type": "cue", **cue.to_json()})


async def asked(
    clinic: Clinic, path: str, answer: int = 200, role: str = "admin", before: str = "/account"
) -> list[str]:
    """Statements that a page takes, once whoever asks is signed in and has seen another."""
    async with clinic.client(role) as client:
        await client.get(before)
        with crowd.statements() as sent:
            response = await client.get(path, headers={FRAGMENT: "numbers"})
    assert response.status_code == answer, response.text
    assert sent, "not even who asks was looked up"
    return sent


@pytest.mark.sweep
async def test_the_patient_list_takes_as_few_statements_for_500_patients_as_for_two(tmp_path: Path) -> None:
    async with open_clinic(tmp_path / "small") as clinic:
        crowd.fill(clinic, 2, 1)
        small = await asked(clinic, "/patients", before="/patients")
    async with open_clinic(tmp_path / "full") as clinic:
        crowd.fill(clinic, 500, 20)
        full = await asked(clinic, "/patients", before="/patients")
        theirs = await asked(clinic, "/patients", role="clinician", before="/patients")
    assert len(full) == len(small) == len(theirs) <= MOST_OF_LIST


@pytest.mark.sweep
@pytest.mark.parametrize("page", PAGES)
async def test_no_page_takes_more_statements_than_20(
    full: tuple[Clinic, Mapping[str, str]], page: str
) -> None:
    clinic, values = full
    path = (page + QUERIES.get(page, "")).format(**values)
    sent = await asked(clinic, path, ANSWERS.get(page, 200))
    assert len(sent) <= MOST, "\n\n".join(sent)


@pytest.mark.sweep
async def test_care_teams_cost_a_list_no_statement(
    full: tuple[Clinic, Mapping[str, str]],
) -> None:
    clinic, values = full
    looked = ("/patients", "/patients/{pid}", "/sessions/{sid}", "/jobs", "/study")
    members = [{"patient_id": p.id, "user_id": clinic.user("clinician"), "since": p.created_at}
               for p in clinic_patients(clinic)]  # fmt: skip
    with clinic.db.write() as c:
        c.execute(insert(care_team_member), members)
    counts = {}
    for on in (False, True):
        async with clinic.client("admin") as client:
            await client.put("/api/v1/care-teams", json={"on": on})
        counts[on] = [len(await asked(clinic, p.format(**values), role="clinician")) for p in looked]
    async with clinic.client("admin") as client:
        await client.put("/api/v1/care-teams", json={"on": False})
    added = [with_teams - without for without, with_teams in zip(*counts.values(), strict=True)]
    # the patient's own page reads the team and who opened the patient in an emergency
    assert added == [0, 2, 0, 0, 0]
    assert max(counts[True]) <= MOST


def clinic_patients(clinic: Clinic) -> list[patients.Patient]:
    with clinic.db.read() as c:
        return patients.list_patients(c, None, limit=1000)


@pytest.mark.sweep
async def test_a_session_page_takes_as_few_statements_for_200_control_visits_as_for_six(
    tmp_path: Path,
) -> None:
    results = analysed.files()
    async with open_clinic(tmp_path) as clinic:
        ((sid,),) = crowd.fill(clinic, 1, 1, results)
        crowd.fill(clinic, 6, 1, results, controls=True)
        few = await asked(clinic, f"/sessions/{sid}")
        crowd.fill(clinic, 50, 4, {"analysis.json": results["analysis.json"]}, controls=True)
        many = await asked(clinic, f"/sessions/{sid}")
    assert len(many) == len(few) <= MOST
