"""Live trials over the API: open, pair, command, close; permissions."""

from __future__ import annotations

import datetime as dt
from collections.abc import AsyncIterator
from contextlib import suppress
from typing import Any

import httpx
import pytest
import websockets
from sqlalchemy import select, update
from sqlalchemy.exc import IntegrityError

from sagittal.server.auth.throttle import MAX_PER_PAIR, Throttle
from sagittal.server.clinic import patients, sessions
from sagittal.server.live_takes.live import ALPHABET
from sagittal.server.storage.schema.live_tables import live_event, live_take
from sagittal.server.storage.schema.tables import now, prescription, recording
from tests.data import ROOT
from tests.helpers.clinic import Clinic, open_clinic
from tests.helpers.live_clinic import closed, heard, new_session, open_code, visit
from tests.helpers.live_takes import finish_text, frame
from tests.server.serving import serve

pytestmark = pytest.mark.anyio


@pytest.fixture(scope="module")
async def clinic(tmp_path_factory: pytest.TempPathFactory, anyio_backend: str) -> AsyncIterator[Clinic]:
    async with open_clinic(tmp_path_factory.mktemp("live"), live_workers=0) as running:
        yield running


@pytest.fixture(scope="module")
async def port(clinic: Clinic) -> AsyncIterator[int]:
    async with serve(clinic.app) as number:
        yield number


@pytest.fixture(autouse=True)
def fresh_throttle(clinic: Clinic) -> None:
    clinic.app.state.throttle = Throttle()


async def pairing(client: httpx.AsyncClient, code: str) -> httpx.Response:
    return await client.post("/api/v1/live/pairings", json={"code": code})


@pytest.mark.slow
async def test_a_code_joins_one_tablet_once(clinic: Clinic) -> None:
    session = new_session(clinic)
    async with clinic.client("clinician") as http, clinic.client() as stranger:
        opened = await http.post(f"/api/v1/sessions/{session}/live")
        assert opened.status_code == 201
        take = opened.json()
        assert len(take["code"]) == 6
        assert set(take["code"]) <= set(ALPHABET)
        left = dt.datetime.fromisoformat(take["expires_at"]) - now()
        assert dt.timedelta(minutes=9) < left <= dt.timedelta(minutes=10)
        spoken = f" {take['code'][:3].lower()}-{take['code'][3:]} "
        paired = await pairing(stranger, spoken)
        assert paired.status_code == 201
        answer = paired.json()
        assert (answer["take"], answer["socket"]) == (take["id"], "/api/v1/live")
        assert answer["session_title"] == "Live training"
        assert answer["patient_code"].startswith("L-")
        repeat = await pairing(stranger, take["code"])
        assert (repeat.status_code, repeat.json()["code"]) == (404, "code_not_valid")
        state = (await http.get(f"/api/v1/sessions/{session}/live")).json()
        assert (state["take"], state["state"], state["tablet"]) == (take["id"], "open", "none")
    with clinic.db.read() as c:
        row = c.execute(select(live_take).where(live_take.c.id == take["id"])).one()
    assert answer["token"] not in str(row)
    assert take["code"] not in str(row)


@pytest.mark.slow
async def test_an_expired_code_and_one_that_was_replaced_are_refused(clinic: Clinic) -> None:
    session = new_session(clinic)
    async with clinic.client("clinician") as http:
        first = await open_code(http, session)
        second = (await http.post(f"/api/v1/sessions/{session}/live/code")).json()["code"]
        assert (await pairing(http, first)).status_code == 404
        with clinic.db.write() as c:
            past = now() - dt.timedelta(seconds=1)
            c.execute(update(live_take).where(live_take.c.session_id == session).values(code_expires_at=past))
        assert (await pairing(http, second)).status_code == 404


@pytest.mark.slow
async def test_guessing_codes_is_throttled(clinic: Clinic) -> None:
    async with clinic.client() as http:
        for _ in range(MAX_PER_PAIR):
            assert (await pairing(http, "222222")).status_code == 404
        refused = await pairing(http, "222222")
        assert (refused.status_code, refused.json()["code"]) == (429, "too_many_attempts")
        assert int(refused.headers["Retry-After"]) > 0


async def test_a_session_has_one_open_take(clinic: Clinic) -> None:
    session = new_session(clinic)
    api = f"/api/v1/sessions/{session}/live"
    async with clinic.client("clinician") as http:
        assert (await http.get(api)).json()["state"] == "none"
        for part in ("code", "close"):
            refused = await http.post(f"{api}/{part}")
            assert (refused.status_code, refused.json()["code"]) == (409, "no_open_take")
        await open_code(http, session)
        refused = await http.post(api)
        assert (refused.status_code, refused.json()["code"]) == (409, "take_open")
        closed = (await http.post(f"{api}/close")).raise_for_status().json()
        assert (closed["state"], closed["recording_id"], closed["count"]) == ("closed", None, 0)
        assert (await http.post(api)).status_code == 201
        assert (await http.get(f"/api/v1/sessions/{'0' * 32}/live")).status_code == 404


@pytest.mark.parametrize("role", ["viewer", "assistant", None])
async def test_who_may_not_run_a_take_gets_neither_api_nor_feed(
    clinic: Clinic, port: int, role: str | None
) -> None:
    async with visit(clinic, port) as v:
        async with clinic.client(role) as http:
            for method, part in (
                ("POST", ""), ("GET", ""), ("POST", "/code"), ("POST", "/close"), ("GET", "/events"),
            ):  # fmt: skip
                answer = await http.request(method, v.api + part)
                assert answer.status_code == (403 if role else 401)
        url = f"ws://127.0.0.1:{port}/sessions/{v.session}/live/feed"
        cookie = {"Cookie": f"sid={clinic.token(role)}"} if role else {}
        with pytest.raises(websockets.exceptions.InvalidStatus) as refused:
            async with websockets.connect(url, additional_headers=cookie):
                pass
        assert refused.value.response.status_code == (403 if role else 401)
        # as docs/reference/api.md says: everything else is under /api/v1, the feed is not
        text = (ROOT / "docs/reference/api.md").read_text(encoding="utf-8")
        assert "`WS /sessions/{id}/live/feed`, the only address here that is **not** under `/api/v1`" in text
        if role is None:
            with pytest.raises(websockets.exceptions.InvalidStatus) as nowhere:
                async with websockets.connect(url.replace("/sessions", "/api/v1/sessions")):
                    pass
            assert nowhere.value.response.status_code == 403


async def test_the_feed_of_another_site_or_of_no_session_is_refused(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v:
        cookie = {"Cookie": f"sid={clinic.token('clinician')}"}
        url = f"ws://127.0.0.1:{port}/sessions/{v.session}/live/feed"
        with pytest.raises(websockets.exceptions.InvalidStatus) as refused:
            async with websockets.connect(
                url, origin=websockets.Origin("http://evil.example"), additional_headers=cookie
            ):
                pass
        assert refused.value.response.status_code == 403
        nowhere = url.replace(v.session, "0" * 32)
        async with websockets.connect(nowhere, additional_headers=cookie) as ws:
            assert (await closed(ws))[0] == 4404


async def test_a_page_that_is_open_before_the_take_sees_every_state(clinic: Clinic, port: int) -> None:
    session = new_session(clinic)
    url = f"ws://127.0.0.1:{port}/sessions/{session}/live/feed"
    cookie = {"Cookie": f"sid={clinic.token('clinician')}"}
    async with websockets.connect(url, additional_headers=cookie) as feed:
        assert (await heard(feed, "state"))["state"] == "none"
        async with visit(clinic, port, session) as v:
            assert (await heard(feed, "state"))["state"] == "pairing"
            assert (await heard(feed, "state"))["state"] == "open"
            async with v.tablet() as ws:
                assert (await heard(feed, "state", tablet="connected"))["state"] == "open"
                await ws.send(frame(0))
                assert (await heard(feed, "state", state="streaming"))["count"] == 1
            assert (await heard(feed, "state", tablet="lost"))["state"] == "streaming"
            body = (await v.http.post(f"{v.api}/close")).json()
            over = await heard(feed, "state", state="closed")
            assert over["recording"] == body["recording_id"] is not None


@pytest.mark.parametrize("repeated", [False, True])
async def test_start_and_end_of_a_test_become_the_recordings_unless_it_is_repeated(
    clinic: Clinic, port: int, repeated: bool
) -> None:
    limits = {"start_s": 1.5, "end_s": 12.25}
    async with visit(clinic, port) as v:
        async with v.tablet() as ws:
            await heard(ws, "welcome")
            await ws.send(frame(0))
            await heard(ws, "ack")
            await v.command("test", "go")
            await v.command("test", {"start_s": 1.0, "end_s": 9.0})
            await v.command("test", limits)
            if repeated:
                await v.command("test", "repeat")
        body = (await v.http.post(f"{v.api}/close")).json()
        with clinic.db.read() as c:
            row = c.execute(select(recording.c.manifest).where(recording.c.id == body["recording_id"])).one()
    assert row.manifest.get("test_limits") == (None if repeated else limits)


async def test_commands_are_checked_kept_and_shown(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v, v.tablet() as ws:
        await heard(ws, "welcome")
        wrong: tuple[tuple[str, Any], ...] = (
            ("feedback", "yes"), ("pause", None), ("level", True), ("level", "1"), ("mark", 3),
            ("start", True), ("jump", None), ("redo_calibration", 1), ("test", None), ("test", "stop"),
            ("test", {"start_s": 5.0, "end_s": 4.0}), ("test", {"start_s": 5.0}),
        )  # fmt: skip
        for name, value in wrong:
            answer = await v.http.post(f"{v.api}/commands", json={"command": name, "value": value})
            assert answer.status_code == 422
        nothing = await v.http.post(f"{v.api}/commands", json={"command": "undo_mark"})
        assert (nothing.status_code, nothing.json()["code"]) == (409, "no_mark")
        await ws.send(frame(0))
        await heard(ws, "ack")
        await v.command("mark", "turn")
        await v.command("mark")
        assert [m["value"] for m in (await v.command("level", -1))["marks"]] == ["turn", None]
        assert [m["value"] for m in (await v.command("undo_mark"))["marks"]] == ["turn"]
        assert (await v.command("ghost", "norm"))["ghost"] == "norm"
        events = (await v.http.get(f"{v.api}/events")).raise_for_status().json()
        kinds = [e["kind"] for e in events]
        assert kinds == ["prescription", "mark", "mark", "level", "undo_mark", "ghost"]
        assert events[3]["content"] == {"value": -1, "before": 1}
        assert {e["by"] for e in events[1:]} == {"clinician"}


async def test_ending_the_sign_in_ends_the_feed(
    clinic: Clinic, port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sagittal.server.auth.access.CHECK_EVERY_S", 0.05)
    async with visit(clinic, port) as v:
        token = clinic.token("clinician")
        url = f"ws://127.0.0.1:{port}/sessions/{v.session}/live/feed"
        async with websockets.connect(url, additional_headers={"Cookie": f"sid={token}"}) as ws:
            await heard(ws, "state")
            async with clinic.client() as http:
                http.cookies.set("sid", token)
                (await http.post("/api/v1/sign-out")).raise_for_status()
            assert await closed(ws) == (1008, "not_signed_in")


async def test_leaving_the_care_team_ends_the_feed_and_says_so(
    clinic: Clinic, port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sagittal.server.auth.access.CHECK_EVERY_S", 0.05)
    async with visit(clinic, port) as v, clinic.client("admin") as admin:
        url = f"ws://127.0.0.1:{port}/sessions/{v.session}/live/feed"
        cookie = {"Cookie": f"sid={clinic.token('clinician')}"}
        try:
            async with websockets.connect(url, additional_headers=cookie) as ws:
                await heard(ws, "state")
                (await admin.put("/api/v1/care-teams", json={"on": True})).raise_for_status()
                assert await closed(ws) == (1008, "not_found")
        finally:
            (await admin.put("/api/v1/care-teams", json={"on": False})).raise_for_status()


async def test_an_erased_patient_leaves_no_take_event_prescription_or_sample(
    clinic: Clinic, port: int
) -> None:
    async with visit(clinic, port) as v:
        admin = clinic.client("admin")
        with clinic.db.read() as c:
            patient = patients.get(c, sessions.get(c, v.session).patient_id)
        written = await v.http.post(
            f"/api/v1/patients/{patient.id}/prescriptions",
            json={
                "parameter": "stance_pct",
                "side": None,
                "target": {"source": "manual", "mean": 60, "sd": 2},
            },
        )
        written.raise_for_status()
        async with v.tablet() as ws:
            await heard(ws, "welcome")
            frames = [frame(i) for i in range(3)]
            for one in frames:
                await ws.send(one)
            await v.command("mark", "CANARY")
            await ws.send(finish_text(frames))
            await heard(ws, "finished")
        (await v.http.post(v.api)).raise_for_status()  # another take, which nobody joins
        sample = frames[1][200:300]

        def found() -> list[str]:
            names = []
            for path in clinic.settings.data_dir.rglob("*"):
                # a log is gone as soon as its take is a file
                with suppress(FileNotFoundError):
                    held = path.read_bytes() if path.is_file() else b""
                    names += [path.name] if sample in held or b"CANARY" in held else []
            return names

        assert found()
        async with admin:
            path = f"/api/v1/patients/{patient.id}"
            assert (await admin.delete(path, params={"confirm": "not it"})).status_code == 409
            assert (await admin.delete(path, params={"confirm": patient.code})).status_code == 204
    assert found() == []
    with clinic.db.read() as c:
        assert c.execute(select(prescription).where(prescription.c.patient_id == patient.id)).first() is None
        mine = select(live_take.c.id).where(live_take.c.session_id == v.session)
        assert c.execute(mine).first() is None
        assert c.execute(select(live_event).where(live_event.c.take_id == v.take)).first() is None


async def test_events_of_a_take_cannot_be_changed(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v, v.tablet() as ws:
        await heard(ws, "welcome")
        await v.command("mark")
        with pytest.raises(IntegrityError, match="append-only"), clinic.db.write() as c:
            c.execute(update(live_event).where(live_event.c.take_id == v.take).values(t_s=1.0))
