"""The tablet's socket of a running server: its door, its order, its end."""

from __future__ import annotations

import asyncio
import datetime as dt
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import websockets
from sqlalchemy import select, update
from websockets.asyncio.client import ClientConnection

from sagittal.core.formats.live_log import StreamInfo
from sagittal.server.live import hub
from sagittal.server.live.protocol import CloseCode
from sagittal.server.live.recorder import Recorder, open_recorder
from sagittal.server.live_takes.live_recordings import log_path
from sagittal.server.storage.schema.live_tables import live_take
from sagittal.server.storage.schema.tables import audit, job, now
from sagittal.server.uploads import recordings
from tests.helpers.clinic import Clinic
from tests.helpers.live_clinic import closed, heard, visit
from tests.helpers.live_takes import HELLO, digest, finish_text, frame

pytestmark = pytest.mark.anyio


async def gone(log: Path) -> None:
    """The log goes when the estimator has been heard out."""
    async with asyncio.timeout(5):
        while log.exists():
            await asyncio.sleep(0.01)


async def acknowledged(ws: ClientConnection, limit: int) -> None:
    while (await heard(ws, "ack"))["ack"] < limit:
        pass


def rows(clinic: Clinic, take: str) -> Any:
    with clinic.db.read() as c:
        return c.execute(select(live_take).where(live_take.c.id == take)).one()


@pytest.mark.slow
async def test_a_take_from_hello_to_a_recording_of_the_same_bytes(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v, v.tablet() as ws:
        assert ws.subprotocol == "sagittal.live.v1"
        assert await heard(ws, "welcome") == {"type": "welcome", "next_seq": 0, "max_unacked": 64}
        assert (await v.state())["tablet"] == "connected"
        frames = [frame(i) for i in range(20)]
        for one in frames:
            await ws.send(one)
        await acknowledged(ws, 20)
        log = log_path(clinic.settings.live, v.take)
        initial_content = log.read_bytes()
        assert (await v.state())["state"] == "streaming"
        assert not (await v.state())["stopping"]
        (await v.http.post(f"{v.api}/commands", json={"command": "stop"})).raise_for_status()
        assert (await v.state())["stopping"]
        await ws.send(finish_text(frames))
        recording_id = (await heard(ws, "finished"))["recording"]
    row = rows(clinic, v.take)
    assert (row.state, row.count, row.sha256, row.problem) == ("finished", 20, digest(frames), None)
    assert row.recording_id == recording_id
    with clinic.db.read() as c:
        current = recordings.current(c, v.session)
        kinds = c.execute(select(job.c.kind).where(job.c.recording_id == recording_id).order_by(job.c.seq))
        assert list(kinds.scalars()) == ["inspect", "analyse"]
        trail = set(c.execute(select(audit.c.action).where(audit.c.resource_id == v.session)).scalars())
    assert {"live.opened", "live.paired", "live.finished", "analysis.requested"} <= trail
    assert current is not None
    assert current.id == recording_id
    (file,) = current.files
    assert file.name.startswith("live-")
    assert file.name.endswith(".sagittal-live")
    content = clinic.app.state.blobs.read(current.patient_id, file.sha256)
    assert content.startswith(initial_content)
    assert current.manifest == {
        "sensors": {"A1": "pelvis", "A2": "foot_l", "B1": "foot_r"},
        "subject": {"height_m": 1.75},
        "protocol": "walk",
    }
    await gone(log)


async def test_a_tablet_that_comes_back_goes_on_where_the_disk_is(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v:
        frames = [frame(i) for i in range(6)]
        async with v.tablet() as ws:
            await heard(ws, "welcome")
            for one in frames[:3]:
                await ws.send(one)
            await acknowledged(ws, 3)
        async with v.tablet() as ws:
            assert (await heard(ws, "welcome"))["next_seq"] == 3
            for one in frames[2:]:  # one of them once more
                await ws.send(one)
            await ws.send(finish_text(frames))
            first = await heard(ws, "finished")
            await ws.send(finish_text(frames))
            assert await heard(ws, "finished") == first
        async with v.tablet() as ws:  # the answer was lost on its way
            assert await heard(ws, "finished") == first
            assert await closed(ws) == (CloseCode.DONE, "take_ended")


async def test_wrong_expired_and_foreign_tokens_are_refused(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as one, visit(clinic, port) as alternative:
        for token in ("wrong", alternative.token):
            async with one.tablet(one.hello(token=token)) as ws:
                assert (await heard(ws, "error"))["code"] == "token_not_valid"
                assert await closed(ws) == (CloseCode.UNAUTHORISED, "token_not_valid")
        with clinic.db.write() as c:
            past = now() - dt.timedelta(seconds=1)
            c.execute(update(live_take).where(live_take.c.id == one.take).values(token_expires_at=past))
        async with one.tablet() as ws:
            assert (await closed(ws))[0] == CloseCode.UNAUTHORISED
    assert not log_path(clinic.settings.live, one.take).exists()


async def test_a_page_of_another_site_cannot_open_the_socket(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v:
        with pytest.raises(websockets.exceptions.InvalidStatus) as refused:
            async with websockets.connect(v.socket, origin=websockets.Origin("http://evil.example")):
                pass
    assert refused.value.response.status_code == 403


@pytest.mark.parametrize("first", ["no json", b"\x00\x01", json.dumps({"type": "finish"}), frame(0)])
async def test_a_first_message_that_is_no_hello_is_refused(
    clinic: Clinic, port: int, first: str | bytes
) -> None:
    async with visit(clinic, port) as v, websockets.connect(v.socket) as ws:
        await ws.send(first)
        assert (await closed(ws))[0] == CloseCode.MALFORMED


async def test_silence_instead_of_a_hello_is_closed(
    clinic: Clinic, port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sagittal.server.live.tablet.HELLO_WITHIN_S", 0.1)
    async with visit(clinic, port) as v, websockets.connect(v.socket) as ws:
        assert await closed(ws) == (CloseCode.NO_HELLO, "no_hello")


async def test_other_sensors_than_at_first_are_refused_and_the_take_stays(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v:
        async with v.tablet() as ws:
            await heard(ws, "welcome")
            await ws.send(frame(0))
            await acknowledged(ws, 1)
        streams: tuple[StreamInfo, ...] = HELLO.streams[:1]
        async with v.tablet(v.hello(replace(HELLO, streams=streams))) as ws:
            assert await closed(ws) == (CloseCode.MALFORMED, "hello_changed")
        async with v.tablet() as ws:
            assert (await heard(ws, "welcome"))["next_seq"] == 1


async def test_damage_gaps_and_oversize_close_with_their_codes(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v:
        for message, code in (
            (frame(0)[:-1] + bytes([frame(0)[-1] ^ 1]), CloseCode.MALFORMED),
            (frame(3), CloseCode.GAP),
            (b"x" * ((1 << 20) + 1), CloseCode.TOO_BIG),
        ):
            async with v.tablet() as ws:
                await heard(ws, "welcome")
                await ws.send(message)
                assert (await closed(ws))[0] == code


async def test_a_second_tablet_with_a_new_code_sends_the_first_away(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v, v.tablet() as first:
        await heard(first, "welcome")
        await first.send(frame(0))
        await acknowledged(first, 1)
        code = (await v.http.post(f"{v.api}/code")).raise_for_status().json()["code"]
        paired = (await v.http.post("/api/v1/live/pairings", json={"code": code})).json()
        old, v.token = v.token, paired["token"]
        async with v.tablet() as second:
            assert (await heard(second, "welcome"))["next_seq"] == 1
            assert (await closed(first))[0] == CloseCode.REPLACED
            async with v.tablet(v.hello(token=old)) as third:
                assert (await closed(third))[0] == CloseCode.UNAUTHORISED


async def test_a_hash_that_differs_keeps_the_take_and_marks_it(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v, v.tablet() as ws:
        await heard(ws, "welcome")
        await ws.send(frame(0))
        await ws.send(json.dumps({"type": "finish", "count": 2, "sha256": "0" * 64}))
        assert (await heard(ws, "error"))["code"] == "finish_mismatch"
        await ws.send(json.dumps({"type": "finish", "count": 1, "sha256": "0" * 64}))
        assert (await heard(ws, "finished"))["problem"] == "finish_mismatch"
    assert (rows(clinic, v.take).state, rows(clinic, v.take).problem) == ("finished", "finish_mismatch")


async def test_a_take_closed_here_tells_the_tablet_and_keeps_what_came(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v, v.tablet() as ws:
        await heard(ws, "welcome")
        await ws.send(frame(0))
        await acknowledged(ws, 1)
        body = (await v.http.post(f"{v.api}/close")).raise_for_status().json()
        assert (body["state"], body["count"]) == ("closed", 1)
        assert await closed(ws) == (CloseCode.ENDED, "take_ended")
        assert (await v.state())["recording"] == body["recording_id"] is not None
        async with v.tablet() as repeat:
            assert (await closed(repeat))[0] == CloseCode.ENDED
        assert (await v.http.post(f"{v.api}/close")).status_code == 409


async def test_a_take_without_a_sample_ends_without_a_recording(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v, v.tablet() as ws:
        await heard(ws, "welcome")
        body = (await v.http.post(f"{v.api}/close")).raise_for_status().json()
        assert (body["state"], body["recording_id"]) == ("closed", None)
    with clinic.db.read() as c:
        assert recordings.current(c, v.session) is None
    await gone(log_path(clinic.settings.live, v.take))


async def test_commands_reach_the_tablet(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v:
        lost = await v.http.post(f"{v.api}/commands", json={"command": "start"})
        assert (lost.status_code, lost.json()["code"]) == (409, "no_tablet")
        async with v.tablet() as ws:
            await heard(ws, "welcome")
            await v.command("start")
            assert await heard(ws, "command") == {"type": "command", "command": "start"}
        async with asyncio.timeout(20):
            while (await v.state())["tablet"] != "lost":
                await asyncio.sleep(0.01)
        lost = await v.http.post(f"{v.api}/commands", json={"command": "stop"})
        assert (lost.status_code, lost.json()["code"]) == (409, "tablet_lost")


async def test_erasing_the_session_ends_its_take(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v, v.tablet() as ws:
        await heard(ws, "welcome")
        await ws.send(frame(0))
        await acknowledged(ws, 1)
        (await v.http.delete(f"/api/v1/sessions/{v.session}")).raise_for_status()
        assert await closed(ws) == (CloseCode.ENDED, "take_ended")
        async with v.tablet() as repeat:
            assert (await closed(repeat))[0] == CloseCode.UNAUTHORISED
    assert not log_path(clinic.settings.live, v.take).exists()


async def test_a_session_erased_just_before_its_log_is_there_leaves_no_log(
    clinic: Clinic, port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with visit(clinic, port) as v:

        async def open_late(*args: Any) -> Recorder:
            (await v.http.delete(f"/api/v1/sessions/{v.session}")).raise_for_status()
            return await open_recorder(*args)

        monkeypatch.setattr(hub, "open_recorder", open_late)
        async with v.tablet() as ws:
            assert (await closed(ws))[0] == CloseCode.UNAUTHORISED
    assert not log_path(clinic.settings.live, v.take).exists()


async def test_a_full_disk_is_said_and_heals(
    clinic: Clinic, port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    from sagittal.server.storage import fs

    async with visit(clinic, port) as v:
        async with v.tablet() as ws:
            await heard(ws, "welcome")
            await ws.send(frame(0))
            await acknowledged(ws, 1)

            def full(fd: int, data: bytes | memoryview) -> int:
                raise OSError(28, "No space left on device")

            with monkeypatch.context() as patch:
                patch.setattr(fs.system, "write", full)
                await ws.send(frame(1))
                assert await closed(ws) == (CloseCode.STORAGE, "storage_full")
        async with v.tablet() as ws:
            assert (await heard(ws, "welcome"))["next_seq"] == 1
            await ws.send(frame(1))
            await acknowledged(ws, 2)
