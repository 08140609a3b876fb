"""Drawings of the avatar: mid-walk for print, and at the start of the replay."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from typing import Any, Final

from sagittal.core.errors import SagittalError
from sagittal.core.events.result import Strides
from sagittal.core.message import Message
from sagittal.server.clinic.patients import Patient
from sagittal.server.report.files.bundle import read_poses
from sagittal.server.report.view.model import ReportModel
from sagittal.server.results import analyses
from sagittal.server.results.histories import AnalysedSession
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.viewer.client import client_version
from sagittal.server.viewer.first_picture import draw_first_picture
from sagittal.server.viewer.motion import prepare_motion
from sagittal.server.viewer.still import draw_still

log = logging.getLogger(__name__)

MOST_FRAMES: Final = 120_000
"""Longer walks have no first frame, which would delay the page: 20 min at 100 Hz."""


def draw_contact(
    reviewed: ReviewedAnalyses, this: AnalysedSession, strides: Strides, patient: Patient
) -> dict[str, str] | None:
    """The avatar at a contact in the middle of the walk, with its caption; None without poses."""
    if "poses.parquet" not in this.found.files:
        return None
    included = [s for s in strides.strides if s.excluded_reason is None]
    mine = [s for s in included if s.side == patient.affected_side] or included
    middle = mine[len(mine) // 2]
    caption = Message("Contact, {side} foot", side=middle.side)
    poses = read_poses(analyses.file_bytes(reviewed.blobs, this.found, "poses.parquet"))
    svg = draw_still(poses, middle.start_s, middle.side, caption)
    return None if svg is None else {"svg": svg, "caption": caption}


def draw_beginning(
    reviewed: ReviewedAnalyses, this: AnalysedSession, model: ReportModel
) -> dict[str, str] | None:
    """First frame of the replay, start time of the page's clock, and the client's URL.

    None if there is nothing to draw; damaged poses do not affect other content of the page.
    """
    if "poses.parquet" not in this.found.files:
        return None
    try:
        poses = read_poses(analyses.file_bytes(reviewed.blobs, this.found, "poses.parquet"))
    except SagittalError as error:
        log.warning("no first picture of session %s: %s", this.session.id, error.code)
        return None
    if not poses.q or not 0 < len(poses.t_s) <= MOST_FRAMES:
        return None
    spans: Sequence[Mapping[str, Any]] = model.replay["strides"]  # type: ignore[assignment]
    first = next((s for s in spans if s["used"]), next(iter(spans), {"start_s": 0.0}))
    svg = draw_first_picture(prepare_motion(poses), first["start_s"])
    return None if svg is None else {"svg": svg, "client": f"/views/client/{client_version()}"}
