"""The live filter of feet that nothing links: what happens to a path that its rests contradict."""

from __future__ import annotations

from dataclasses import replace

import pytest

from core.frames import Segment
from core.online import LiveStride
from core.recording import UniformRecording
from tests.helpers.live_walks import live
from tests.helpers.walks import cut, only, simulated

STRIDE_S = 1.1
"""From the fault on: the stride that it falls into has no length."""


def repeated(recording: UniformRecording, segment: Segment, start_s: float, end_s: float) -> UniformRecording:
    """The same take in which one sensor sends its last sample again for a while, as if it were measured."""
    x = recording.sensors[segment]
    a, b = round(start_s * recording.rate_hz), round(end_s * recording.rate_hz)
    acc, gyr = x.acc.copy(), x.gyr.copy()
    acc[a:b], gyr[a:b] = acc[a - 1], gyr[a - 1]
    return replace(recording, sensors={**recording.sensors, segment: replace(x, acc=acc, gyr=gyr)})


def strides_of(take: UniformRecording, size: int = 10) -> list[LiveStride]:
    """As they were told last, those whose values do not change any more."""
    told = {s.n: s for f in live(take, size)[1] for s in f.strides}
    return [s for s in told.values() if s.complete]


@pytest.mark.parametrize(("start_s", "length_s"), [(15.5, 0.2), (15.9, 0.3)])
def test_a_path_that_its_rest_contradicts_begins_anew(start_s: float, length_s: float) -> None:
    """Too short to be called a frozen sensor; all strides after it were half or three times as long."""
    take = only(cut(simulated("comfortable", 1)[0], 0.0, 22.0), "foot_l", "foot_r")
    whole = strides_of(take)
    found = strides_of(repeated(take, "foot_l", start_s, start_s + length_s))
    after = [s for s in found if s.start_s > start_s + STRIDE_S and s.counted]
    assert {s.side for s in after} == {"left", "right"}
    for s in found:
        length = s.values["stride_length_m"]
        same = [x for x in whole if x.side == s.side and abs(x.end_s - s.end_s) < 0.1]
        if not s.counted or not same or same[0].values["stride_length_m"] is None:
            continue
        if length is None:
            assert s not in after, (s.side, s.end_s, s.reasons["stride_length_m"])
        else:
            assert length == pytest.approx(same[0].values["stride_length_m"], abs=0.1), (s.side, s.end_s)


def test_it_begins_anew_at_the_same_sample_whatever_the_blocks_are() -> None:
    take = only(cut(simulated("comfortable", 1)[0], 0.0, 18.0), "foot_l", "foot_r")
    take = repeated(take, "foot_l", 15.3, 15.6)
    by_size = [[(s.n, dict(s.values)) for s in strides_of(take, size)] for size in (10, 37)]
    assert by_size[0] == by_size[1]
