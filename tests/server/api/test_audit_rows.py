"""Who looked at whose data: a walk over the table of routes, so that no route is forgotten."""

from __future__ import annotations

import hashlib
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
import websockets

from sagittal.server import audit
from sagittal.server.auth.roles import Action
from sagittal.server.auth.routes import list_declared_actions
from sagittal.server.auth.tokens import token_hash
from sagittal.server.clinic import patients, sessions
from sagittal.server.jobs.queue import Claim
from sagittal.server.pages.shell import FRAGMENT
from sagittal.server.results import tunings
from sagittal.server.sharing import signed_reports
from sagittal.server.sharing.signed_reports import DOCUMENT, PSEUDONYMISED
from sagittal.server.storage.field_cipher import make_keys
from sagittal.server.storage.schema.tables import job, new_id, tuning
from sagittal.server.trail import MOST_REFUSED, QUIET_S, AuditTrail
from sagittal.server.uploads import reference_files, videos
from tests.helpers.clinic import PASSWORD, Clinic, open_clinic
from tests.helpers.engines import on_both_engines
from tests.server import analysed, walk
from tests.server.serving import serve

pytestmark = pytest.mark.anyio

API = "/api/v1"
CONTACT = walk.events().times("left", "ic")[3]

OF_NO_PATIENT = {
    Action.SIGN_IN,
    Action.SET_UP,
    Action.CHECK_HEALTH,
    Action.LOAD_ASSET,
    Action.USE_ACCOUNT,
    Action.WATCH_SIGN_IN,
    Action.READ_API,
    Action.READ_DEVICE,  # serial numbers and days, nobody who wore them
    Action.MANAGE_USERS,
    Action.READ_AUDIT,
    Action.READ_SYSTEM,
    Action.PAIR,  # its row is "live.paired" (test_tablet.py)
    Action.STREAM,  # a tablet sends, and is told nothing but numbers of batches
    Action.READ_SHARED,  # its row is "report_link.opened", of nobody (pages/test_report.py)
}
"""Routes of every other action show or change what belongs to a patient."""

WITHOUT_A_ROW = {
    "GET /": "leads to the list",
    "GET /patients/{pid}/compare": "leads to the comparison",
    "GET /views/{view_id}/": "of a view that the replay or the live figure opened, with their row",
    "WEBSOCKET /views/{view_id}": "the same",
    "GET /api/v1/jobs/{job_id}/events": "tells how far a job is, and of nobody",
    "POST /api/v1/jobs/{job_id}/cancel": "of a job that is over nothing is cancelled",
    "HEAD /api/v1/sessions/{session_id}/uploads/{upload_id}": "tells how far an upload is, and of nobody",
    "PATCH /api/v1/sessions/{session_id}/uploads/{upload_id}": "a part of what begins and ends with a row",
    "POST /api/v1/sessions/{session_id}/tables/checks": "of a table whose list has left the row",
    "POST /api/v1/emergency-accesses/{access_id}/end": "of others; in auth/test_belongings.py",
    "POST /api/v1/emergency-accesses": "administrators need none; of others in auth/test_belongings.py",
    "POST /api/v1/sessions/{session_id}/live/commands": "needs a tablet; kept as live events with the person",
}

QUERY = {
    "GET /api/v1/patients/{patient_id}/targets": "?parameter=stance_pct",
    "DELETE /api/v1/patients/{patient_id}": "?confirm=P-1",
    "PUT /api/v1/sessions/{session_id}/video": "?name=walk.webm&consent=true",
}

TRAINING = {
    "parameter": "stance_pct",
    "side": "left",
    "target": {"source": "manual", "mean": 62.0, "sd": 2.0},
}
EDIT = {"kind": "exclude_stride", "side": "left", "time_s": CONTACT + 0.5, "reason": "stumbled"}
PATIENT, SESSION = f"{API}/patients/{{patient_id}}", f"{API}/sessions/{{session_id}}"
CHANGES: dict[str, dict[str, Any]] = {
    f"POST {API}/patients": {"json": {"code": "P-2"}},
    f"PATCH {PATIENT}": {"json": {"note": "uses a stick"}},
    f"PATCH {PATIENT}/identity": {"json": {"name": "Erika Muster"}},
    f"POST {PATIENT}/notes": {"json": {"content": "Walks to the bakery."}},
    f"DELETE {API}/notes/{{note_id}}": {},
    f"POST {PATIENT}/consents": {"json": {"purpose": "research", "evidence": "signed form"}},
    f"POST {API}/consents/{{consent_id}}/withdraw": {},
    f"POST {PATIENT}/sessions": {"json": {"title": "Walk"}},
    f"POST {PATIENT}/programmes": {"json": {"starts_on": "2026-03-02"}},
    f"PATCH {API}/planned-visits/{{visit_id}}": {"json": {"planned_on": "2026-03-05"}},
    f"DELETE {API}/programmes/{{programme_id}}": {},
    f"POST {PATIENT}/prescriptions": {"json": TRAINING},
    f"POST {API}/prescriptions/{{prescription_id}}/end": {},
    f"PATCH {SESSION}": {"json": {"title": "Walk"}},
    f"POST {SESSION}/edits": {"json": EDIT},
    f"DELETE {SESSION}/edits": {},
    f"POST {SESSION}/edits/redo": {},
    f"PUT {SESSION}/files/{{name:path}}": {"content": b"x"},
    f"POST {SESSION}/files": {"files": {"files": ("judge.npz", b"x")}},
    f"DELETE {SESSION}/files/{{name:path}}": {},
    f"POST {SESSION}/uploads": {"json": {"name": "large.csv", "size": 1}},
    f"POST {SESSION}/uploads/{{upload_id}}/finish": {"json": {"sha256": hashlib.sha256(b"x").hexdigest()}},
    f"DELETE {SESSION}/uploads/{{upload_id}}": {},
    f"PUT {SESSION}/tables": {
        "json": {"files": ["judge.npz"], "source": {"columns": {"A1": {"acc": ["x", "y", "z"]}}}}
    },
    f"PUT {SESSION}/manifest": {"json": {"sensors": {"A1": "pelvis"}}},
    f"POST {SESSION}/inspections": {},
    f"POST {SESSION}/analyses": {"json": {}},
    f"POST {SESSION}/tunings": {"json": {"algorithm": "mahony_2008", "validation": ["judge"]}},
    f"POST {SESSION}/filter-runs": {"json": {"filters": ["mahony_2008"]}},
    f"POST {SESSION}/sensitivities": {"json": {"from_standing": False}},
    f"POST {SESSION}/exports": {"json": {"kind": "csv"}},
    f"PUT {SESSION}/references/{{name:path}}": {"content": b"x"},
    f"DELETE {SESSION}/references/{{name:path}}": {},
    f"PUT {SESSION}/video": {"content": b"\x1a\x45\xdf\xa3 and pictures"},
    f"PATCH {SESSION}/video": {"json": {"offset_s": 1.5}},
    f"DELETE {SESSION}/video": {},
    f"POST {API}/signed-reports/{{report_id}}/reopen": {"json": {"reason": "Typing error"}},
    f"PUT {SESSION}/assessment": {"json": {"content": "Walks faster."}},
    "POST /sessions/{sid}/report/sign": {"json": {}},
    f"POST {API}/signed-reports/{{report_id}}/links": {"json": {"days": 3}},
    f"DELETE {API}/report-links/{{link_id}}": {},
    f"POST {SESSION}/live": {},
    f"POST {SESSION}/live/code": {},
    f"POST {SESSION}/live/close": {},
    f"DELETE {SESSION}": {},
    f"DELETE {PATIENT}": {},
}
"""A valid request of every kind, in an order in which each can be carried out."""


class Visits:
    """Patient with two analysed sessions, and the ids needed by the routes."""

    def __init__(self, clinic: Clinic) -> None:
        self.clinic = clinic
        make_keys(clinic.settings.identity_key_file)
        with clinic.db.write() as c:
            patient = patients.create(c, None, code="P-1", height_m=1.75).id
            this, second = (sessions.create(c, None, patient).id for _ in range(2))
            squats = sessions.create(c, None, patient, protocol="squat").id
        analysed.finish(clinic, patient, squats, analysed.files())
        analysed.finish(clinic, patient, second, analysed.files())
        analysis = analysed.finish(clinic, patient, this, analysed.files())
        with clinic.db.write() as c:
            first = c.execute(job.select().limit(1)).one()
            job_id = first.id
            claim = Claim(job_id, 1, "w", "tune", first.recording_id, None, {"input_sha256": "0" * 64})
            tunings.publish(c, claim, {tunings.RESULT: b"{}"}, {})
            tuning_id = c.execute(tuning.select()).one().id
        run = analysed.compare(clinic, patient, this)
        self.squats = squats
        sensitivity = analysed.put_off(clinic, patient, squats)
        with reference_files.receive_reference(
            clinic.db, clinic.app.state.blobs, clinic.settings, None, this, "optical.sto"
        ) as upload:
            upload.write(b"x")
            upload.keep()
        with videos.receive_video(
            clinic.db, clinic.app.state.blobs, clinic.settings, None, this, "walk.webm"
        ) as film:
            film.write(b"\x1a\x45\xdf\xa3 and pictures")
            film.keep()
        blobs, report = clinic.app.state.blobs, new_id()
        stored = {name: blobs.put(patient, b"<p>Signed</p>") for name in (DOCUMENT, PSEUDONYMISED)}
        with clinic.db.write() as c:
            signature = signed_reports.prepare_signature(c, this, report, "Anna")
            signed_reports.keep_signed(c, None, signature, this, analysis, "en", stored)
        self.values = {
            "report_id": report,
            "patient_id": patient,
            "pid": patient,
            "session_id": this,
            "sid": this,
            "other_id": second,
            "other": second,
            "analysis_id": analysis,
            "job_id": job_id,
            "tuning_id": tuning_id,
            "run_id": run,
            "sensitivity_id": sensitivity,
        }
        self.ids = {patient, this, second, analysis, job_id, tuning_id, run, squats, sensitivity, None}

    def address(self, route: str) -> str:
        """The route with its parameters filled; fails for one that this test does not know."""
        path = route.partition(" ")[2]
        names = {
            "references": "optical.sto",
            "files": "walk.txt",
            "parameters": "stride_time_s",
            "signals": "foot_pitch",
        }
        if path.startswith(f"{API}/analyses"):
            names["files"] = "events.csv"
        if path.startswith(f"{API}/filter-runs"):
            names["files"] = "filters.csv"

        def value(result: re.Match[str]) -> str:
            name = result[1]
            if name == "session_id" and path.endswith("/sensitivities"):
                return self.squats
            return names[path[: result.start()].split("/")[-2]] if name == "name" else self.values[name]

        return re.sub(r"\{(\w+)(?::path)?\}", value, path) + QUERY.get(route, "")

    def newest(self) -> int:
        return self.rows(1)[0].seq if self.rows(1) else 0

    def rows(self, limit: int = 20) -> list[Any]:
        with self.clinic.db.read() as c:
            return audit.list_entries(c, limit=limit)

    def rows_of(self, name: str, since: int) -> list[Any]:
        """Rows about these visits by a person since a row."""
        result = [r for r in self.rows() if r.seq > since and r.user_name == name]
        return [r for r in result if r.resource_id in self.ids or r.resource == "recording"]


@asynccontextmanager
async def opened(folder: Path) -> AsyncIterator[Visits]:
    async with open_clinic(folder, live_workers=0) as clinic:
        yield Visits(clinic)


def of_patients(clinic: Clinic) -> list[str]:
    actions = list_declared_actions(clinic.app.routes)
    return [route for route, action in actions.items() if action not in OF_NO_PATIENT]


async def _look(v: Visits, route: str, port: int) -> None:
    """Open a route with a fresh sign-in; whoever has looked a moment ago writes no second row."""
    address = v.address(route)
    if route.startswith("WEBSOCKET"):
        cookie = {"Cookie": f"sid={v.clinic.token('clinician')}"}
        origin = websockets.Origin(f"http://127.0.0.1:{port}")
        url = f"ws://127.0.0.1:{port}{address}"
        async with websockets.connect(url, origin=origin, additional_headers=cookie) as socket:
            await socket.recv()
        return
    async with v.clinic.client("clinician") as client:
        answer = await client.get(address, headers={FRAGMENT: "numbers"})
    assert answer.status_code == 200, f"{route}: {answer.text}"


@on_both_engines
@pytest.mark.slow
async def test_every_route_that_shows_patient_data_leaves_an_audit_row(tmp_path: Path) -> None:
    async with opened(tmp_path) as v, serve(v.clinic.app) as port:
        routes = [r for r in of_patients(v.clinic) if r.split()[0] in {"GET", "WEBSOCKET"}]
        assert len(routes) > 40
        silent = []
        for route in routes:
            if route in WITHOUT_A_ROW or route.endswith(".pdf"):  # PDFs: pages/test_report.py
                continue
            initial = v.newest()
            await _look(v, route, port)
            if not v.rows_of("clinician", initial):
                silent.append(route)
        assert silent == []


@pytest.mark.slow
@on_both_engines
async def test_every_route_that_changes_patient_data_leaves_an_audit_row(tmp_path: Path) -> None:
    async with opened(tmp_path) as v:
        routes = {r for r in of_patients(v.clinic) if r.split()[0] not in {"GET", "WEBSOCKET"}}
        assert routes - set(WITHOUT_A_ROW) == set(CHANGES), "say what a request of this route needs"
        silent = []
        async with v.clinic.client("admin") as client:
            for route, body in CHANGES.items():
                initial = v.newest()
                answer = await client.request(route.split()[0], v.address(route), **body)
                assert answer.status_code < 300, f"{route}: {answer.text}"
                result = answer.json() if answer.content else {}
                if "offset" in result:
                    v.values |= {"upload_id": result["id"]}
                    part = f"{v.address(route)}/{result['id']}"
                    await client.patch(part, content=b"x", headers={"Upload-Offset": "0"})
                if "visits" in result:
                    v.values |= {"programme_id": result["id"], "visit_id": result["visits"][0]["id"]}
                if "evidence" in result:
                    v.values |= {"consent_id": result["id"]}
                if "id" in result and "sha256" in result:
                    v.values["report_id"] = result["id"]
                if "link" in result:
                    v.values["link_id"] = result["link"]["id"]
                if "content" in result:
                    v.values |= {"prescription_id": result["id"], "note_id": result["id"]}
                if not [r for r in v.rows() if r.seq > initial and r.user_name == "admin"]:
                    silent.append(route)
        assert silent == []


def test_no_route_without_a_row_is_excused_for_nothing(clinic: Clinic) -> None:
    assert set(WITHOUT_A_ROW) <= set(of_patients(clinic))


@pytest.mark.slow
async def test_watching_is_one_row_of_each_sign_in_and_quarter_of_an_hour(tmp_path: Path) -> None:
    time_s = 0.0
    async with opened(tmp_path) as v:
        v.clinic.app.state.trail = AuditTrail(v.clinic.db, lambda: time_s)
        path = v.address(f"GET {SESSION}/signals/{{name}}")

        def rows() -> int:
            return sum(r.action == "signals.opened" for r in v.rows(1000))

        async with v.clinic.client("viewer") as client, v.clinic.client("viewer") as second_client:
            for _ in range(5):
                await client.get(path)
            assert rows() == 1
            await second_client.get(path)
            assert rows() == 2
            time_s += QUIET_S
            await client.get(path)
            assert rows() == 3


async def _fail(clinic: Clinic, **person: str) -> None:
    async with clinic.client() as client:
        answer = await client.post(f"{API}/sign-in", json=person)
        assert answer.status_code == 401


@pytest.mark.slow
async def test_a_failed_sign_in_is_a_row_without_what_was_typed(tmp_path: Path) -> None:
    async with opened(tmp_path) as v:
        reference = v.clinic.user("viewer")
        await _fail(v.clinic, name="viewer", password="swordfish-of-the-viewer")
        await _fail(v.clinic, name="swordfish-as-a-name", password="x")
        async with v.clinic.client() as client:
            assert (await client.get("/sign-in/not-a-token")).status_code == 404
            wrong = await client.post(f"{API}/live/pairings", json={"code": "ABCDEFGH"})
            assert wrong.status_code == 404, wrong.text
        async with v.clinic.client("viewer") as client:
            change = {"current": "swordfish", "password": "a few unrelated words"}
            assert (await client.post(f"{API}/account/password", json=change)).status_code == 403
        rows = list(reversed(v.rows(5)))
        assert [(r.action, r.resource_id, r.user_id, r.detail) for r in rows] == [
            ("sign_in.failed", reference, None, {"address": "127.0.0.1"}),
            ("sign_in.failed", None, None, {"address": "127.0.0.1"}),
            ("sign_in.failed", None, None, {"address": "127.0.0.1"}),
            ("live.pairing_failed", None, None, {"address": "127.0.0.1"}),
            ("sign_in.failed", reference, None, {"address": "127.0.0.1"}),
        ]
        assert "swordfish" not in str(v.rows(1000))
        person = {"name": "viewer", "password": PASSWORD}
        async with v.clinic.client() as client:
            assert (await client.post(f"{API}/sign-in", json=person)).status_code == 200
            assert (v.rows(1)[0].action, v.rows(1)[0].detail) == ("sign_in", {"factor": "password"})
            assert token_hash(client.cookies["sid"]) not in str(v.rows(1))


@pytest.mark.slow
async def test_somebody_who_guesses_all_day_cannot_fill_the_disk(tmp_path: Path) -> None:
    time_s = 0.0
    async with opened(tmp_path) as v:
        trail = AuditTrail(v.clinic.db, lambda: time_s)

        def told() -> list[dict[str, Any]]:
            return [r.detail for r in v.rows(1000) if r.action == "sign_in.failed"]

        for i in range(MOST_REFUSED + 50):
            trail.record_refused("sign_in.failed", "user", None, f"2001:db8::{i:x}" + "x" * 1000)
        assert len(told()) == MOST_REFUSED
        assert max(len(d["address"]) for d in told()) <= 64
        time_s += 3600.0
        trail.record_refused("sign_in.failed", "user", None, "192.0.2.1")
        assert told()[0] == {"address": "192.0.2.1", "more": 50}
