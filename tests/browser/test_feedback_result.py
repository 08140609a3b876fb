"""What feedback did is on the session page and on paper."""

from __future__ import annotations

from contextlib import closing

import pytest
from playwright.sync_api import expect

from sagittal.core.feedback import FeedbackEngine
from sagittal.server.results import analyses, edit_log, prescriptions
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_folder import FolderBlobs
from tests.browser import filling
from tests.browser.conftest import Opener, RunningServer
from tests.browser.design import all_faults
from tests.helpers.feedback import Walked
from tests.server.feedback import ended_take

GIVEN = {
    "parameter": "step_length_m",
    "side": "left",
    "target": {"source": "manual", "mean": 0.68, "sd": 0.02},
    "schedule": {"kind": "every", "probe_every": 6, "probe_strides": 3},
}


@pytest.fixture(scope="module")
def trained(running: RunningServer) -> str:
    """A session whose strides got the cues that the engine gives."""
    files, sensors = filling.simulated_files()
    with running.client() as client:
        patient = filling.add(client, "/patients", code="P-0120", height_m=1.76, affected_side="left")["id"]
        session = str(filling.add_session(client, patient, "Training 1"))
        filling.upload(client, session, files)
        assert filling.analyse(client, session, sensors)["state"] == "done"
        filling.add(client, f"/patients/{patient}/prescriptions", **GIVEN)
    blobs = FolderBlobs(running.folder / "blobs")
    reviewed = ReviewedAnalyses(blobs)
    with closing(Database(running.folder / "sagittal.db")) as db:
        with db.read() as c:
            analysis = analyses.get_shown(c, session)
            edits = edit_log.edits_of(c, analysis.id)
            inputs = prescriptions.for_take(c, reviewed, session)
        assert inputs is not None
        engine = FeedbackEngine(*inputs)
        lengths = reviewed.read_columns(analysis, edits)["step_length_m"]
        strides = reviewed.read_bundle(analysis, edits).strides.strides
        frames = [
            engine.push(
                Walked(
                    n, s.side, s.start_s, s.end_s, s.end_s, {"step_length_m": length}, {},
                    counted=s.excluded_reason is None,
                )
            )
            for n, (s, length) in enumerate(zip(strides, lengths, strict=True))
        ]  # fmt: skip
        cues = [cue for cue in frames if cue is not None]
        ended_take(db, blobs, session, cues, analysis.recording_id)
    return session


def test_a_session_shows_its_strides_with_and_without_feedback(opened: Opener, trained: str) -> None:
    page = opened(f"/sessions/{trained}", stays=True)
    section = page.get_by_role("region", name="Feedback")
    expect(section).to_contain_text("Step length, left: target 0.680 ± 0.020")
    rows = section.get_by_role("row")
    expect(rows.filter(has_text="With feedback").first).to_be_visible()
    strides = int(rows.filter(has_text="With feedback").first.get_by_role("cell").first.inner_text())
    assert strides > 5
    assert section.locator("circle.fb-on").count() == strides + 1, "each stride, and the legend"
    expect(section).to_contain_text("Probe block")
    expect(section).to_contain_text("Sagittal profile score")
    page.get_by_text("Prescription").click()
    faults = all_faults(page)
    assert not faults, "\n".join(faults)


def test_feedback_has_a_sheet_of_its_own_on_paper(opened: Opener, trained: str) -> None:
    page = opened(f"/sessions/{trained}/print", stays=True)
    sheet = page.locator("article.sheet").last
    expect(sheet.get_by_role("heading", name="Feedback")).to_be_visible()
    assert sheet.evaluate("s => s.scrollHeight <= s.clientHeight + 1"), "one sheet"
