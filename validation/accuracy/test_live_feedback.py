"""Feedback over a whole live walk: every cue finds its stride in the analysis of the same take.

A virtual person with hemiparesis walks, the chain calibrates itself on the first steps, and the engine judges
its strides; what the person was told is then held against the finished analysis.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import pytest

from sagittal.core.feedback import AnalysedStride, Cue, FeedbackEngine, FeedbackSplit, Prescription, split
from sagittal.core.online import LiveFrame
from sagittal.core.parameters.measure import MeasuredGait
from tests.helpers.live_walks import live
from tests.helpers.walks import analysed, simulated
from validation.figures import record, record_in_short

WHO, SEED = "hemiparetic", 3

LIMITS = {
    "stance_pct": (0.5, 0.5),
    "single_support_pct": (0.5, 0.5),
    "step_length_m": (0.015, 0.005),
    "gait_speed_mps": (0.015, 0.005),
    "knee_flexion_max_swing_deg": (0.5, 0.3),
    "foot_pitch_ic_deg": (0.5, 0.3),
}
"""Largest |mean| and sd of live minus final value: a quarter of a level of some 2 %, 5 cm, 0.1 m/s or 5°."""


@cache
def frames(*sizes: int) -> Sequence[LiveFrame]:
    return live(simulated(WHO, SEED)[0], sizes)[1]


@cache
def offline() -> MeasuredGait:
    measured = analysed(WHO, SEED).measured
    assert measured is not None
    return measured


def coached(parameter: str, *sizes: int) -> list[Cue]:
    given = Prescription.from_json(
        {
            "parameter": parameter,
            "side": "left",
            "target": {"source": "manual", "mean": 1.0, "sd": 0.1},
            "schedule": {"kind": "fading", "shares_pct": [100, 50], "strides_per_share": 4,
                         "probe_every": 4, "probe_strides": 2},
        }
    )  # fmt: skip
    engine = FeedbackEngine(given)
    found = (engine.push(stride, frame.t_s) for frame in frames(*sizes) for stride in frame.strides)
    return [cue for cue in found if cue is not None]


def matched(parameter: str) -> tuple[list[Cue], FeedbackSplit, int]:
    """Cues, what they found, and how many strides of the side count in the end."""
    cues = coached(parameter, 10)
    measured = offline()
    strides = [
        AnalysedStride(s.side, s.start_s, value, s.excluded_reason is None)
        for s, value in zip(measured.strides.strides, measured.columns[parameter], strict=True)
    ]
    return cues, split(strides, cues), sum(s.counted and s.side == "left" for s in strides)


@pytest.mark.parametrize("parameter", LIMITS)
def test_every_cue_finds_its_stride_and_told_nearly_its_final_value(parameter: str) -> None:
    cues, found, counted = matched(parameter)
    assert found.unmatched == 0
    assert len(found.strides) >= 0.9 * counted, "few strides that count in the end were not coached"
    assert found.left_out <= 0.1 * len(cues), "some are only seen to be the last of a walk afterwards"
    told = found.live_difference
    assert told.mean is not None
    assert told.sd is not None
    mean, sd = LIMITS[parameter]
    assert abs(told.mean) < mean
    assert told.sd < sd


def test_what_was_told_is_written_down_beside_what_was_found() -> None:
    rows = []
    for parameter in LIMITS:
        cues, found, _ = matched(parameter)
        told = found.live_difference
        numbers = f"{told.mean:+.3f} ± {told.sd:.3f}"
        rows.append((parameter, str(len(cues)), str(found.unmatched), str(found.left_out), numbers))
    told = matched("knee_flexion_max_swing_deg")[1].live_difference
    record_in_short(
        "Live cue − final value, knee flexion °",
        "–",
        f"{told.mean:+.3f} ± {told.sd:.3f}",
        f"simulated, {WHO}",
    )
    record(
        "Live feedback",
        ("parameter", "cues", "no stride found", "stride does not count", "told minus final"),
        rows,
        f"A virtual person ({WHO}, seed {SEED}) walks live; mean ± SD over strides, in the parameter's unit.",
    )


def test_the_cues_do_not_depend_on_how_the_tablet_cuts_its_batches() -> None:
    assert coached("step_length_m", 10) == coached("step_length_m", 7, 23)
