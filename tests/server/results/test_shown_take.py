"""Jobs on the analysis that a session shows."""

from __future__ import annotations

import pytest
from sqlalchemy import select

from sagittal.server.results import analyses
from sagittal.server.results.analyses import AnalysisRecord
from sagittal.server.results.shown_take import make_key, submit_for, submit_on_shown
from sagittal.server.storage.schema.tables import audit, job
from sagittal.server.uploads import recordings
from sagittal.server.uploads.recordings import RecordedFile
from tests.helpers.clinic import Clinic
from tests.server import feedback


@pytest.fixture
def found(stored: Clinic) -> AnalysisRecord:
    session = feedback.walked(stored, feedback.person(stored), 0, 12.0)
    with stored.db.read() as c:
        return analyses.get_shown(c, session)


def test_a_job_has_the_files_and_settings_of_the_analysis_and_its_own_parameters(
    stored: Clinic, found: AnalysisRecord
) -> None:
    against = RecordedFile("reference.c3d", 5, "c" * 64)
    with stored.db.write() as c:
        view = submit_on_shown(
            c, stored.app.state.queue, None, found, "compare", "filters.asked", against=against, methods=["a"]
        )
        plain = submit_on_shown(
            c, stored.app.state.queue, None, found, "compare", "filters.asked", against=None, methods=["a"]
        )
        scalar_one = c.execute(select(job.c.params).where(job.c.id == view.id)).scalar_one()
        mine = recordings.get(c, found.recording_id)
        noted = c.execute(select(audit.c.action, audit.c.resource_id).order_by(audit.c.seq.desc())).first()
    assert [f["name"] for f in scalar_one["files"]] == [*(f.name for f in mine.files), "reference.c3d"]
    assert scalar_one["files"][-1] == {"name": "reference.c3d", "size": 5, "sha256": "c" * 64}
    assert (scalar_one["analysis_id"], scalar_one["methods"]) == (found.id, ["a"])
    assert scalar_one["manifest"] == (found.manifest or {})
    assert (view.kind, view.recording_id) == ("compare", found.recording_id)
    assert plain.id != view.id
    assert noted is not None
    assert tuple(noted) == ("filters.asked", found.session_id)


def test_the_same_job_is_done_once(stored: Clinic, found: AnalysisRecord) -> None:
    queue = stored.app.state.queue
    with stored.db.write() as c:
        first, second, alternative, kind = (
            submit_for(c, queue, None, found, kind, "asked", params).id
            for kind, params in (
                ("export", {"a": 1, "b": 2}),
                ("export", {"b": 2, "a": 1}),
                ("export", {}),
                ("tune", {}),
            )
        )
    assert first == second
    assert len({first, alternative, kind}) == 3


def test_a_key_names_analysis_kind_and_parameters(found: AnalysisRecord) -> None:
    key = make_key(found, "export", {"kind": "csv"})
    assert key.startswith(f"{found.id}:export:")
    assert make_key(found, "export", {"kind": "csv"}) == key
    assert make_key(found, "export", {"kind": "c3d"}) != key
    assert make_key(found, "tune", {"kind": "csv"}) != key
