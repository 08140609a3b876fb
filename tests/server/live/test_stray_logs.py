"""Live logs that are damaged or unknown to the database: kept, reported, adopted."""

from __future__ import annotations

import asyncio
from contextlib import closing
from pathlib import Path

import pytest

from sagittal.core.formats.live_log import FILE_MARK, hello_json, record
from sagittal.server.clinic import jobs, sessions
from sagittal.server.errors import Conflict
from sagittal.server.live.hub import Hub
from sagittal.server.live.room import Room
from sagittal.server.live.take import ActiveTake
from sagittal.server.live_takes import live, live_events, live_logs, live_recordings
from sagittal.server.main import main
from sagittal.server.safekeeping import checks
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_folder import FolderBlobs
from sagittal.server.uploads import recordings
from tests.helpers.clinic import Clinic, open_clinic
from tests.helpers.engines import tell_commands
from tests.helpers.live_clinic import PATIENCE_S, heard, new_session, visit
from tests.helpers.live_takes import HELLO, frame, stored
from tests.server.serving import serve

pytestmark = pytest.mark.anyio

FRAMES = [frame(i) for i in range(20)]
STRAY = "a" * 32
WHOLE = FILE_MARK + record("H", hello_json(HELLO)) + b"".join(record("B", one) for one in FRAMES)


def put_stray(folder: Path, content: bytes = WHOLE) -> Path:
    path = live_recordings.log_path(folder / "live", STRAY)
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(content)
    return path


def findings(settings: Settings) -> list[str]:
    with closing(Database(settings.database_source)) as db:
        result = checks.check(db, FolderBlobs(settings.blobs), settings)
    return [f"{f.area}: {f.message}" for f in result]


def flip(path: Path, position: int) -> bytes:
    """Flip one bit of a file and return its new content."""
    content = bytearray(path.read_bytes())
    content[position] ^= 1
    path.write_bytes(content)
    return bytes(content)


async def interrupted(folder: Path) -> tuple[Clinic, str, str]:
    """Stop a server in the middle of a take; session and take."""
    async with (
        open_clinic(folder, live_workers=0) as clinic,
        serve(clinic.app) as port,
        visit(clinic, port) as v,
        v.tablet() as ws,
    ):
        await heard(ws, "welcome")
        for one in FRAMES:
            await ws.send(one)
        path = live_recordings.log_path(clinic.settings.live, v.take)
        async with asyncio.timeout(PATIENCE_S):
            while not path.exists() or len(stored(path)) < len(FRAMES):
                await asyncio.sleep(0.02)
    return clinic, v.session, v.take


async def test_a_log_that_the_database_does_not_know_is_kept_listed_and_adopted(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    async with open_clinic(tmp_path, live_workers=0) as clinic:
        session = new_session(clinic)
        tell_commands(monkeypatch, clinic.settings)
    path = put_stray(tmp_path)
    async with open_clinic(tmp_path, live_workers=0) as clinic:
        assert path.read_bytes() == WHOLE
        assert f"knows nothing of {path}" in caplog.text
        [message] = findings(clinic.settings)
        assert message.startswith(f"live: the database knows nothing of {path.name}")
        assert "3 sensors, 20 batches" in message

        capsys.readouterr()
        data = ["--data", str(tmp_path)]
        assert main(["adopt", *data]) == 0
        assert STRAY in capsys.readouterr().out
        assert main(["adopt", *data, STRAY, "--session", f"http://127.0.0.1:8000/sessions/{session}"]) == 0
        assert f"/sessions/{session}" in capsys.readouterr().out
        assert not path.exists()
        with clinic.db.read() as c:
            current = recordings.require_current(c, session)
            take = live.get(c, STRAY)
        assert (take.state, take.recording_id, take.count) == ("closed", current.id, 20)
        [file] = current.files
        with clinic.db.read() as c:
            patient = sessions.get(c, session).patient_id
        assert clinic.app.state.blobs.read(patient, file.sha256) == WHOLE
        with clinic.db.read() as c:
            assert recordings.ANALYSE in {view.kind for view in jobs.of_session(c, session)}
        assert findings(clinic.settings) == []
        assert main(["adopt", *data]) == 0
        assert "knows every live recording" in capsys.readouterr().out


@pytest.mark.slow
async def test_what_cannot_be_adopted_is_refused_with_a_sentence_and_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    async with open_clinic(tmp_path, live_workers=0) as clinic:
        session = new_session(clinic)
        tell_commands(monkeypatch, clinic.settings)
        data = ["adopt", "--data", str(tmp_path)]
        empty = put_stray(tmp_path, b"no log at all")
        for words, reason in (
            ([*data, STRAY], "Give both"),
            ([*data, "--session", session], "Give both"),
            ([*data, "b" * 32, "--session", session], "no live log"),
            ([*data, "../sagittal", "--session", session], "no live log"),
            ([*data, STRAY, "--session", session], "has no readable sample"),
        ):
            assert main(words) != 0
            assert reason in capsys.readouterr().err
        assert empty.read_bytes() == b"no log at all"
        put_stray(tmp_path)
        assert main([*data, STRAY, "--session", "c" * 32]) == 1
        assert "no session" in capsys.readouterr().err
        place = (clinic.db, clinic.app.state.blobs, clinic.settings, clinic.app.state.queue, None)
        live_logs.adopt(*place, STRAY, session)
        path = put_stray(tmp_path)
        with pytest.raises(Conflict, match="already belongs to a visit"):
            live_logs.adopt(*place, STRAY, session)
        assert path.read_bytes() == WHOLE


@pytest.mark.parametrize("broken", ["copy", "publish"])
@pytest.mark.slow
async def test_an_adoption_that_dies_half_way_is_finished_by_the_next_start(
    tmp_path: Path, broken: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dies(*_: object) -> None:
        raise RuntimeError("the power is gone")

    async with open_clinic(tmp_path, live_workers=0) as clinic:
        session = new_session(clinic)
        path = put_stray(tmp_path)
        place = (clinic.db, clinic.app.state.blobs, clinic.settings, clinic.app.state.queue, None)
        with monkeypatch.context() as patch:
            patch.setattr(f"sagittal.server.live_takes.live_recordings._{broken}", dies)
            with pytest.raises(RuntimeError):
                live_logs.adopt(*place, STRAY, session)
        assert path.read_bytes() == WHOLE
    async with open_clinic(tmp_path, live_workers=0) as clinic:
        assert not path.exists()
        with clinic.db.read() as c:
            assert live.get(c, STRAY).recording_id == recordings.require_current(c, session).id


@pytest.mark.slow
async def test_a_damaged_log_keeps_its_original_and_the_session_says_so(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    clinic, session, take = await interrupted(tmp_path)
    path = live_recordings.log_path(clinic.settings.live, take)
    hurt = flip(path, path.stat().st_size // 2)
    [message] = findings(clinic.settings)
    assert message.startswith(f"live: {take}.log: ")
    assert "bytes of the live recording were damaged" in message
    users = clinic.users
    async with open_clinic(tmp_path, live_workers=0) as clinic:
        clinic.users = users
        original = path.with_name(f"{take}.1.damaged")
        assert original.read_bytes() == hurt
        assert 0 < len(stored(path)) < len(FRAMES)
        assert "damaged on the server's disk" in caplog.text
        async with clinic.client("clinician") as http:
            async with asyncio.timeout(PATIENCE_S):
                while "Part of the live recording was lost" not in (
                    page := (await http.get(f"/sessions/{session}")).text
                ):
                    await asyncio.sleep(0.05)
        assert "damaged on the server&#39;s disk" in page
        [message] = findings(clinic.settings)
        assert original.name in message
        hub: Hub = clinic.app.state.hub
        row = hub.rows.take(take)
        second = ActiveTake(hub, row, Room(), *hub.rows.prepare(row))
        assert second._seen["notice"] == 0  # or the estimator's first notice would be taken for told
        async with clinic.client("clinician") as http:
            assert (await http.delete(f"/api/v1/sessions/{session}")).status_code == 204
        assert not original.exists()
        assert findings(clinic.settings) == []


async def test_a_log_without_a_readable_sample_is_not_thrown_away(tmp_path: Path) -> None:
    clinic, session, take = await interrupted(tmp_path)
    path = live_recordings.log_path(clinic.settings.live, take)
    hurt = flip(path, len(FILE_MARK) + 20)
    with closing(Database(clinic.settings.database_source)) as db, db.write() as c:
        live.end(c, None, take, "closed", count=0)
    async with open_clinic(tmp_path, live_workers=0) as clinic:
        assert not path.exists()
        assert path.with_name(f"{take}.1.damaged").read_bytes() == hurt
        with clinic.db.read() as c:
            [text] = live_events.list_damages(c, session)
        assert "damaged on the server's disk" in text
        assert any(".1.damaged" in finding for finding in findings(clinic.settings))
