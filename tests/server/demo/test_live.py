from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest

from sagittal.core.feedback import Cue
from sagittal.core.subject.condition import USUAL
from sagittal.server.clinic import patients, sessions
from sagittal.server.demo.clinic import PRESCRIBED
from sagittal.server.demo.live import open_take, plan_training, stream_walk
from sagittal.server.live_takes import live, live_events
from sagittal.server.results import prescriptions
from sagittal.server.storage.schema.tables import session
from tests.helpers.clinic import open_clinic
from tests.server.serving import serve


@pytest.mark.slow
@pytest.mark.anyio
async def test_the_demo_s_live_patient_walks_is_told_how_and_becomes_a_recording(tmp_path: Path) -> None:
    async with open_clinic(tmp_path, live_workers=1, min_free_bytes=0) as clinic, serve(clinic.app) as port:
        person, content = PRESCRIBED
        with clinic.db.write() as c:
            fields = {k: v for k, v in vars(person).items() if k != "code"}
            someone = patients.create(c, None, code=person.code, **fields)
            prescriptions.write(c, clinic.app.state.reviewed, None, someone.id, content)
        code = open_take(clinic.settings)
        result = plan_training(laps=1)
        # a client with a loop of its own, as in the demo
        await asyncio.to_thread(
            lambda: asyncio.run(stream_walk(f"http://127.0.0.1:{port}", code, result.recording, speed=10.0))
        )
        with clinic.db.read() as c:
            sid = c.execute(session.select()).one().id
        async with asyncio.timeout(60):
            while True:
                with clinic.db.read() as c:
                    take = live.current(c, sid)
                    cues = [e for e in live_events.events(c, take.id) if e.kind == "cue"] if take else []
                    walked = sessions.get(c, sid).walked()
                if take is not None and take.recording_id is not None and len(cues) > 10:
                    break
                await asyncio.sleep(0.2)
    assert take.state == "finished"
    assert take.problem is None
    assert {e.content["side"] for e in cues} == {"left"}
    assert any(Cue.from_json(e.content).with_feedback for e in cues)
    assert walked == replace(USUAL, feedback=True), "noted by the take itself"
