"""The figure as a drawing: at a contact in the middle of the walk, and where the replay begins."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sagittal.core.frames import Side
from sagittal.server.clinic import patients, sessions
from sagittal.server.pages.results import figures
from sagittal.server.pages.results.figures import draw_beginning, draw_contact
from sagittal.server.report.files.bundle import read_poses
from sagittal.server.results import analyses, histories, reports
from sagittal.server.storage.files.blobs import Blob
from sagittal.server.viewer.client import client_version
from sagittal.server.viewer.still import draw_still
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio


async def test_a_contact_of_the_affected_side_is_drawn_with_its_caption(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    with clinic.db.write() as c:
        pid = patients.create(c, None, code="FG-1").id
        sid = sessions.create(c, None, pid).id
    analysed.finish(clinic, pid, sid, analysed.files())
    with clinic.db.read() as c:
        patient = patients.get(c, pid)
        (this,) = histories.list_analysed(c, pid)
    reviewed = clinic.app.state.reviewed
    strides = reviewed.read_bundle(this.found, this.edits).strides
    poses = read_poses(analyses.file_bytes(reviewed.blobs, this.found, "poses.parquet"))
    sides: tuple[Side, ...] = ("left", "right")
    for side in sides:
        drawn = draw_contact(reviewed, this, strides, replace(patient, affected_side=side))
        assert drawn is not None
        assert drawn["caption"] == f"Contact, {side} foot"
        mine = [x for x in strides.strides if x.side == side and x.excluded_reason is None]
        middle = mine[len(mine) // 2]
        assert len(mine) > 3
        assert drawn["svg"] == draw_still(poses, middle.start_s, side, drawn["caption"])
    counted_strides = [s for s in strides.strides if s.excluded_reason is None]
    any_side = draw_contact(reviewed, this, strides, patient)
    assert any_side is not None
    assert any_side["caption"] == f"Contact, {counted_strides[len(counted_strides) // 2].side} foot"
    model = reports.read(reviewed, this.found, this.edits, patient, this.session)[1]
    first = draw_beginning(reviewed, this, model)
    assert first is not None
    assert first["client"] == f"/views/client/{client_version()}"
    none = replace(this, found=replace(this.found, files={}))
    assert draw_contact(reviewed, none, strides, patient) is None
    assert draw_beginning(reviewed, none, model) is None
    gone = replace(this, found=replace(this.found, files={"poses.parquet": Blob("0" * 64, 9)}))
    assert draw_beginning(reviewed, gone, model) is None, "damaged poses hide no number"
    monkeypatch.setattr(figures, "MOST_FRAMES", 10)
    assert draw_beginning(reviewed, this, model) is None
