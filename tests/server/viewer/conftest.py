from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.report.files.exports import poses_parquet
from sagittal.server.results import analyses
from sagittal.server.uploads import receiving, recordings
from sagittal.server.viewer.motion import ReplayMotion, prepare_motion
from tests.helpers.clinic import Clinic, open_clinic
from tests.server import analysed, walk
from tests.server.serving import serve


@pytest.fixture(scope="session")
def motion() -> ReplayMotion:
    return prepare_motion(walk.poses())


@dataclass
class Ward:
    """A clinic on a port with a visit that can be replayed, one not analysed, and one without a figure."""

    clinic: Clinic
    port: int
    session_id: str
    empty_session_id: str
    trunk_session_id: str

    def cookie(self, role: str = "clinician") -> dict[str, str]:
        """Header of a fresh sign-in."""
        return {"Cookie": f"sid={self.clinic.token(role)}"}

    def url(self, path: str) -> str:
        """Websocket address of a path."""
        return f"ws://127.0.0.1:{self.port}{path}"


@asynccontextmanager
async def open_ward(folder: Path) -> AsyncIterator[Ward]:
    """Serve a clinic on a folder."""
    async with open_clinic(folder) as clinic, serve(clinic.app) as port:
        with clinic.db.write() as c:
            patient_id = patients.create(c, None, code="V-1").id
            session_id, empty_id, trunk_id = (sessions.create(c, None, patient_id).id for _ in range(3))
        _finish_analysis(clinic, patient_id, session_id, {"poses.parquet": poses_parquet(walk.poses())})
        no_figure = {name: x for name, x in analysed.files().items() if name != "poses.parquet"}
        _finish_analysis(clinic, patient_id, trunk_id, no_figure)
        yield Ward(clinic, port, session_id, empty_id, trunk_id)


@pytest.fixture(scope="module")
async def ward(tmp_path_factory: pytest.TempPathFactory, anyio_backend: str) -> AsyncIterator[Ward]:
    async with open_ward(tmp_path_factory.mktemp("clinic")) as opened:
        yield opened


@pytest.fixture(scope="module")
def loop() -> Iterator[asyncio.AbstractEventLoop]:
    """Event loop in a separate thread, since playwright's synchronous interface occupies this one."""
    running = asyncio.new_event_loop()
    thread = threading.Thread(target=running.run_forever, daemon=True)
    thread.start()
    yield running
    running.call_soon_threadsafe(running.stop)
    thread.join()
    running.close()


@pytest.fixture(scope="module")
def served(loop: asyncio.AbstractEventLoop, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Ward]:
    ward = open_ward(tmp_path_factory.mktemp("clinic"))
    yield asyncio.run_coroutine_threadsafe(ward.__aenter__(), loop).result(30)
    asyncio.run_coroutine_threadsafe(ward.__aexit__(None, None, None), loop).result(30)


def _finish_analysis(clinic: Clinic, patient_id: str, session_id: str, files: Mapping[str, bytes]) -> None:
    """Do what upload and worker do, with poses whose truth is known instead of a computed result."""
    state = clinic.app.state
    with receiving.receive(clinic.db, state.blobs, clinic.settings, None, session_id, "walk.txt") as upload:
        upload.write(b"recording")
        upload.keep()
    with clinic.db.write() as c:
        analyses.submit(c, state.queue, None, session_id)
    claim = state.queue.claim("test", [recordings.ANALYSE])
    stored = {name: state.blobs.put(patient_id, content) for name, content in files.items()}
    assert state.queue.finish(claim, lambda c: analyses.publish(c, claim, stored, "0" * 64))
