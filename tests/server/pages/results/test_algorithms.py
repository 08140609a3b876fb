"""The page that compares filters on a take."""

from __future__ import annotations

import re

import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.jobs.queue import COMPARE_FILTERS
from sagittal.server.pages.results.algorithms import FILE_WORDS, list_choices
from sagittal.server.report.files.filter_files import filter_run_files
from sagittal.server.report.words.filter_list import PROPOSED
from sagittal.server.results import filter_runs
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio


async def test_a_comparison_is_chosen_followed_and_shown_with_its_files(clinic: Clinic) -> None:
    state = clinic.app.state
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="AL-1").id
        session = sessions.create(c, None, patient).id
    with clinic.db.read() as c:
        initial_choices = list_choices(c, session)
    assert (initial_choices["analysed"], initial_choices["work"], initial_choices["chosen"]) == (
        False,
        None,
        PROPOSED,
    )
    analysed.finish(clinic, patient, session, analysed.files())
    with clinic.db.write() as c:
        filter_runs.submit(
            c,
            state.queue,
            None,
            session,
            filters=["mahony_2008", "wu_2018"],
            magnetometer=False,
            reference=None,
        )
    with clinic.db.read() as c:
        waiting = list_choices(c, session)
    assert (waiting["analysed"], waiting["work"]["state"], waiting["work"]["live"]) == (True, "queued", True)
    claim = state.queue.claim("test", [COMPARE_FILTERS])
    files = filter_run_files(analysed.comparison())
    stored = {name: state.blobs.put(patient, content) for name, content in files.items()}
    assert state.queue.finish(claim, lambda c: filter_runs.publish(c, claim, {}, stored))
    assert set(files) <= set(FILE_WORDS), "every file is said in words"
    with clinic.db.read() as c:
        (run,) = filter_runs.of_session(c, session)
    path = f"/sessions/{session}/algorithms"
    async with clinic.client("viewer") as client:
        page = (await client.get(path)).text
        assert (await client.get(f"{path}?run=none&over=time")).status_code == 200
        assert (await client.get(f"{path}?over=day")).status_code == 422
    led = set(re.findall(rf'href="/api/v1/filter-runs/{run.id}/files/([^"]+)"', page))
    assert led == set(files)
    assert all(FILE_WORDS[name] in page for name in files)
    async with clinic.client("assistant") as client:
        assert (await client.get(path)).status_code == 403
