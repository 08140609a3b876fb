"""The page of jobs."""

from __future__ import annotations

from typing import get_args

import pytest

from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Role
from sagittal.server.clinic import patients, sessions
from sagittal.server.jobs.queue import BESIDE, JobState
from sagittal.server.pages.clinic.jobs import JOB_WORDS, KIND_WORDS, list_jobs
from sagittal.server.uploads import receiving, recordings
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio


def test_every_state_and_kind_has_words() -> None:
    assert set(JOB_WORDS) == set(get_args(JobState))
    assert set(KIND_WORDS) == {recordings.INSPECT, recordings.ANALYSE, *BESIDE}


async def test_jobs_are_listed_newest_first_with_visit_and_time(clinic: Clinic) -> None:
    state = clinic.app.state
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="JO-1").id
        session = sessions.create(c, None, patient, title="First walk").id
    analysed.finish(clinic, patient, session, analysed.files())
    with receiving.receive(clinic.db, state.blobs, clinic.settings, None, session, "more.txt") as upload:
        upload.write(b"more")
        upload.keep()
    with clinic.db.write() as c:
        recordings.inspect(c, state.queue, None, session)
    identity = Identity(clinic.user("viewer"), "viewer", "", Role.VIEWER, "")
    with clinic.db.read() as c:
        waiting, done = list_jobs(c, identity)
    assert (waiting["word"], waiting["what"], waiting["took"], waiting["live"]) == (
        "Waiting", "Reading the files", None, True,
    )  # fmt: skip
    assert (done["word"], done["shape"], done["what"], done["live"]) == ("Done", "ok", "Analysis", False)
    assert done["took"].endswith("s")
    assert done["session"] == {"id": session, "code": "JO-1", "title": "First walk"}
    async with clinic.client("viewer") as client:
        page = (await client.get("/jobs")).text
    assert page.index("Reading the files") < page.index("First walk")
    assert f"/sessions/{session}" in page
