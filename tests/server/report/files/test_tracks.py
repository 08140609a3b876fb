"""Doubts of the signals are stored with the tracks, so that they hold after an edit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sagittal.core.consistency.doubt import LATE_FOOT, Doubt
from sagittal.core.errors import Notice
from sagittal.core.events.result import GaitEvents
from sagittal.core.parameters.measure import Tracks
from sagittal.server.report.files.tracks import read_tracks, tracks_parquet


def test_doubts_are_read_as_they_were_written() -> None:
    tracks = Tracks(np.arange(10) / 100.0, 100.0, GaitEvents(()), {}, {})
    doubted = replace(tracks, doubts=(Doubt(Notice(LATE_FOOT, "Late.", "foot_l"), "between_feet"),))
    for x in (tracks, doubted):
        assert read_tracks(tracks_parquet(x), x.events, None).doubts == x.doubts
