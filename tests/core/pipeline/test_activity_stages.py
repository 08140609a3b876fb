"""Daily life: which sensor it is read from, and how far it can be relied on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.activity.result import ActivityKind, ActivityResult, ActivitySpan
from sagittal.core.errors import Notice, SignalError
from sagittal.core.frames import Segment
from sagittal.core.pipeline.activity_stages import find_trunk_stream, judge_activity, list_doubts, share_known
from sagittal.core.pipeline.analysis import TakeAnalysis
from sagittal.core.pipeline.config import PipelineConfig
from sagittal.core.signals.recording import ImuStream, Recording
from tests.core.formats.making import signals, stream

ACC, GYR = signals(200)
STREAMS = {d: stream(d, ACC + i, GYR) for i, d in enumerate(("A1", "B2"))}


def lived(*spans: tuple[ActivityKind, float], notices: tuple[Notice, ...] = ()) -> ActivityResult:
    """Spans of so many minutes, one after the other."""
    ends = np.cumsum([60.0 * minutes for _, minutes in spans]).tolist()
    starts = [0.0, *ends][: len(spans)]
    return ActivityResult(
        segment="chest",
        device_id="A1",
        source="a.csv",
        rate_hz=50.0,
        has_gyro=True,
        started_at=None,
        duration_s=ends[-1] if ends else 0.0,
        height_m=1.7,
        spans=tuple(
            ActivitySpan(a, b, kind, None, "steps")
            for a, b, (kind, _) in zip(starts, ends, spans, strict=True)
        ),
        transitions=(),
        candidates=(),
        bouts=(),
        steps_s=np.zeros(0),
        turns=(),
        hours=(),
        days=(),
        periods=(),
        inclination_deg=np.zeros(0),
        notices=notices,
    )


@pytest.mark.parametrize(
    ("segments", "found"),
    [
        ({"A1": "pelvis", "B2": "chest"}, ("chest", "B2")),
        ({"A1": "pelvis", "B2": "foot_l"}, ("pelvis", "A1")),
        ({"B2": "chest"}, ("chest", "B2")),
    ],
)
def test_the_chest_is_read_before_the_pelvis(
    segments: Mapping[str, Segment | None], found: tuple[Segment, str]
) -> None:
    segment, long = find_trunk_stream(Recording(STREAMS, segments))
    assert (segment, long.device_id) == found


def test_a_single_sensor_that_nobody_assigned_is_on_the_chest() -> None:
    one: dict[str, ImuStream] = {"A1": STREAMS["A1"]}
    assert find_trunk_stream(Recording(one, {}))[0] == "chest"
    for recording in (Recording(one, {"A1": "foot_l"}), Recording(STREAMS, {}), Recording({}, {})):
        with pytest.raises(SignalError) as caught:
            find_trunk_stream(recording)
        assert caught.value.code == "no_trunk_sensor"
        assert all(d in caught.value.message for d in recording.streams)


def test_the_share_is_of_the_time_worn() -> None:
    assert share_known(lived(("sitting", 3), ("unknown", 1), ("non_wear", 50), ("gap", 50))) == 0.75
    assert share_known(lived(("non_wear", 5), ("gap", 5))) == 0.0
    assert share_known(lived()) == 0.0


@pytest.mark.parametrize(
    ("spans", "notices", "doubts"),
    [
        ([("sitting", 91), ("unknown", 9)], (), []),
        ([("sitting", 89), ("unknown", 11)], (), ["Posture is unknown for 11 % of the wear time."]),
        ([("sitting", 91), ("gap", 9)], (), []),
        ([("sitting", 89), ("gap", 11)], (), ["No data for 11 % of the time."]),
        ([("sitting", 9)], ("no_baseline",), ["Without walking, the vertical is uncertain."]),
        ([("sitting", 9)], ("baseline_assumed",), ["Without walking, the vertical is uncertain."]),
        ([("sitting", 9)], ("read_in_blocks",), []),
    ],
)
def test_what_is_not_good_is_said(
    spans: list[tuple[ActivityKind, float]], notices: tuple[str, ...], doubts: list[str]
) -> None:
    result = lived(*spans, notices=tuple(Notice(code, "So.") for code in notices))
    assert list(list_doubts(result)) == doubts


@pytest.mark.parametrize(("unknown", "level"), [(5, "good"), (40, "usable"), (50, "usable"), (51, "poor")])
def test_half_of_the_time_must_be_known_to_be_of_use(unknown: float, level: str) -> None:
    messages = (Notice("a", "A warning."), Notice("b", "Said.", severity="info"))
    result = lived(("sitting", 100 - unknown), ("unknown", unknown), notices=messages)
    analysis = replace(TakeAnalysis(Recording({}, {})), activity=result)
    report = judge_activity(analysis, PipelineConfig()).quality
    assert report.level == level
    assert [n.code for n in report.notices] == ["a"]
    assert (report.duration_s, report.rate_hz) == (6000.0, 50.0)


def test_without_anything_read_it_is_poor() -> None:
    report = judge_activity(TakeAnalysis(Recording({}, {})), PipelineConfig()).quality
    assert (report.level, report.reasons) == ("poor", ("The sensor provided no usable data.",))
