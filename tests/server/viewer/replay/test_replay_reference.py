"""Walks of curves over a replay: of the norm, and of one side for both legs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.report.files.bundle import read_poses
from sagittal.server.results import analyses, histories
from sagittal.server.viewer.motion import prepare_motion
from sagittal.server.viewer.reference import SAGITTAL
from sagittal.server.viewer.replay.replay_reference import _average_side, find_references
from tests.helpers.clinic import Clinic, open_clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio


async def test_norm_and_sides_are_found_when_they_are_asked_for_and_once(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    async with open_clinic(tmp_path_factory.mktemp("clinic")) as clinic:
        check(clinic)


def check(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        pid = patients.create(c, None, code="RR-1", sex="male", birth_year=1960, height_m=1.75).id
        sid = sessions.create(c, None, pid).id
    analysed.finish(clinic, pid, sid, analysed.files())
    with clinic.db.read() as c:
        patient = patients.get(c, pid)
        (this,) = histories.list_analysed(c, pid)
    reviewed = clinic.app.state.reviewed
    motion = prepare_motion(read_poses(analyses.file_bytes(reviewed.blobs, this.found, "poses.parquet")))
    references = find_references(reviewed, this, patient, motion)
    assert list(references) == ["norm", "left", "right"]
    curves = {side: _average_side(reviewed, this, side) for side in ("left", "right")}
    for side, mine in curves.items():
        ghost = references[side]()  # type: ignore[index]
        assert (ghost is not None) == (set(SAGITTAL) <= set(mine)), side
        assert references[side]() is ghost  # type: ignore[index]
    norm = references["norm"]()
    assert norm is not None
    assert len(norm.frames) == len(motion.t_s)
    assert references["norm"]() is norm
    height_m = norm.batches["pelvis"].position[norm.frames >= 0][..., 2]
    assert np.ptp(height_m) < 0.08, "the pelvis of a healthy walk hardly rises"
    assert 0.85 < height_m.mean() < 0.95
    # rad, not degrees: no joint of a walk turns by more than a third of a turn
    assert all(abs(x).max() < 2.1 for mine in curves.values() for x in mine.values())
    without = replace(
        this,
        found=replace(
            this.found,
            files={k: v for k, v in this.found.files.items() if k != "angles.parquet"},
            id="0" * 32,
        ),
    )
    assert _average_side(reviewed, without, "left") == {}
