"""What lists say of a visit."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.live_takes import live
from sagittal.server.pages.clinic.visit_state import (
    LIVE_STATES,
    STATES,
    describe_live,
    describe_state,
    judge_visit,
)
from sagittal.server.results import analyses, edit_log
from sagittal.server.storage.files.blobs import Blob
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio


def test_every_state_has_a_shape_and_a_word_of_its_own() -> None:
    assert set(STATES) == {"empty", "uploaded", "running", "done", "failed"}
    assert len({text for _, text in STATES.values()}) == len(STATES)
    assert describe_state("failed") == {"kind": "bad", "text": "Not analysable"}
    assert set(LIVE_STATES) == {"pairing", "open", "streaming"}


async def test_an_analysed_visit_is_judged_by_its_data_and_others_by_their_state(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="VS-1").id
        session = sessions.create(c, None, patient).id
    analysed.finish(clinic, patient, session, analysed.files())
    reviewed = clinic.app.state.reviewed
    with clinic.db.write() as c:
        s = sessions.get(c, session)
        analysis = analyses.get_shown(c, session)
        edits = edit_log.edits_of_all(c, [analysis.id])
        take, _ = live.open_take(c, None, session)
    kind, text = reviewed.read_verdict(analysis, edits[analysis.id])
    assert judge_visit(reviewed, s, analysis, edits) == {"kind": kind, "text": text}
    assert text != STATES["done"][1]
    running = replace(s, state="running")
    assert judge_visit(reviewed, running, analysis, edits) == describe_state("running")
    assert judge_visit(reviewed, s, None, edits) == describe_state("done")
    without = replace(analysis, files={})
    assert judge_visit(reviewed, s, without, edits) == describe_state("done")
    damaged = replace(analysis, id="0" * 32, files={"analysis.json": Blob("0" * 64, 9)})
    unreadable = judge_visit(reviewed, s, damaged, {"0" * 32: edits[analysis.id]})
    assert unreadable == {"kind": "bad", "text": "Cannot be read"}
    sentence = describe_live(live_record(clinic, take.id))
    assert sentence == {"session": session, "kind": "none", "text": "Waiting for the tablet"}


def live_record(clinic: Clinic, take: str) -> live.LiveTakeRecord:
    with clinic.db.read() as c:
        return next(t for t in live.list_running(c) if t.id == take)
