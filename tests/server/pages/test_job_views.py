"""Jobs as pages show them: which are followed, which belong to a session."""

from __future__ import annotations

from typing import Any

import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.jobs.queue import JobView
from sagittal.server.pages.job_views import (
    FOLLOWED,
    find_active_jobs,
    find_newest_job,
    follow_few,
    view_job,
)
from sagittal.server.results import filter_runs
from sagittal.server.storage.schema.tables import now
from sagittal.server.uploads import receiving, recordings
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio


def job(state: Any) -> JobView:
    ended = now() if state in {"done", "failed", "cancelled"} else None
    return JobView("1", "analyse", None, state, 1, None, None, None, False, None, None, now(), None, ended)


@pytest.mark.parametrize("state", ["queued", "running", "done", "failed", "cancelled"])
def test_a_job_is_followed_until_it_ends(state: str) -> None:
    view = view_job(job(state))
    assert (view["active"], view["live"]) == ((state in {"queued", "running"}),) * 2
    assert (view["state"], view["kind"]) == (state, "analyse")


def test_of_many_only_a_few_are_followed_and_those_that_run_first() -> None:
    states = ["queued", "done", "queued", "queued", "running", "queued"]
    view: list[dict[str, Any] | None] = [*(view_job(job(s)) for s in states), None]
    follow_few(view)
    followed = [k for k, j in enumerate(view) if j is not None and j["live"]]
    assert followed == [0, 2, 4]
    assert len(followed) == FOLLOWED
    assert [k for k, j in enumerate(view) if j is not None and j["active"]] == [0, 2, 3, 4, 5]


async def test_what_runs_beside_an_analysis_is_no_news_of_the_session(clinic: Clinic) -> None:
    state = clinic.app.state
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="JV-1").id
        session = sessions.create(c, None, patient).id
    assert find_nothing(clinic, session) is None
    analysed.finish(clinic, patient, session, analysed.files())
    with clinic.db.write() as c:
        filter_runs.submit(
            c, state.queue, None, session, filters=["mahony_2008"], magnetometer=False, reference=None
        )
    with clinic.db.read() as c:
        newest = find_newest_job(c, session)
        assert newest is not None
        assert (newest.kind, newest.state) == (recordings.ANALYSE, "done")
        assert find_active_jobs(c, [patient], lambda j: j.session_id) == {}
    with receiving.receive(clinic.db, state.blobs, clinic.settings, None, session, "more.txt") as upload:
        upload.write(b"more")
        upload.keep()
    with clinic.db.write() as c:
        requests = recordings.inspect(c, state.queue, None, session)
    with clinic.db.read() as c:
        active_jobs = find_active_jobs(c, [patient], lambda j: j.session_id)
        assert find_active_jobs(c, [patient], lambda j: j.patient_id).keys() == {patient}
        assert find_active_jobs(c, [], lambda j: j.session_id) == {}
    assert [(key, j["id"], j["live"]) for key, j in active_jobs.items()] == [(session, requests.id, True)]


def find_nothing(clinic: Clinic, session: str) -> JobView | None:
    with clinic.db.read() as c:
        return find_newest_job(c, session)
