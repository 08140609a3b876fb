"""A stroke patient on a treadmill: every stride of the paretic foot, which hardly pitches."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.formats import list_source_files, parse_manifest, read_recording
from sagittal.core.frames import SIDES, Segment
from sagittal.core.pipeline import TakeAnalysis, analyse
from tests.data import data_folder

WORN: dict[str, Segment] = {"47787": "foot_l", "47796": "foot_r"}
STRIDES = 126
"""Of each foot: 127 contacts, by the peaks of its gyroscope."""
CADENCE_PER_MIN = 125.3

pytestmark = [pytest.mark.recorded, pytest.mark.slow]


@cache
def walk() -> TakeAnalysis:
    files = list(list_source_files(sorted(data_folder("stroke_treadmill").glob("MT_*.txt"))))
    whole = read_recording(files, parse_manifest(b'{"sources": [{"file": "*.txt", "rate_hz": 100}]}'))
    segments = {d: WORN[d[-5:]] for d in whole.streams if d[-5:] in WORN}
    return analyse(replace(whole, streams={d: whole.streams[d] for d in segments}, segments=segments))


def test_every_stride_of_both_feet_is_found() -> None:
    strides = walk().strides
    assert strides is not None
    for side in SIDES:
        own = [s for s in strides.strides if s.side == side]
        assert len(own) == STRIDES
        typical = float(np.median([s.end_s - s.start_s for s in own]))
        assert 120.0 / typical == pytest.approx(CADENCE_PER_MIN, abs=1.0)
