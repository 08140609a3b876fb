"""Feedback over a whole live walk: every cue matches a stride of the analysed trial.

A virtual person with hemiparesis walks, the chain calibrates itself on the first steps, and the engine judges
its strides; cues are compared with the finished analysis.
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
    inputs = Prescription.from_json(
        {
            "parameter": parameter,
            "side": "left",
            "target": {"source": "manual", "mean": 1.0, "sd": 0.1},
            "schedule": {"kind": "fading", "shares_pct": [100, 50], "strides_per_share": 4,
                         "probe_every": 4, "probe_strides": 2},
        }
    )  # fmt: skip
    engine = FeedbackEngine(inputs)
    result = (engine.push(stride, frame.t_s) for frame in frames(*sizes) for stride in frame.strides)
    return [cue for cue in result if cue is not None]


def matched(parameter: str) -> tuple[list[Cue], FeedbackSplit, int]:
    """Cues, matched strides, and number of finally counted strides of the side."""
    cues = coached(parameter, 10)
    measured = offline()
    strides = [
        AnalysedStride(s.side, s.start_s, value, s.excluded_reason is None)
        for s, value in zip(measured.strides.strides, measured.columns[parameter], strict=True)
    ]
    return cues, split(strides, cues), sum(s.counted and s.side == "left" for s in strides)


@pytest.mark.parametrize("parameter", LIMITS)
def test_every_cue_finds_its_stride_and_told_nearly_its_final_value(parameter: str) -> None:
    cues, result, counted_strides = matched(parameter)
    assert result.unmatched == 0
    assert len(result.strides) >= 0.9 * counted_strides, "few strides that count in the end were not coached"
    assert result.left_out <= 0.1 * len(cues), "some are only seen to be the last of a walk afterwards"
    live_difference = result.live_difference
    assert live_difference.mean is not None
    assert live_difference.sd is not None
    mean, sd = LIMITS[parameter]
    assert abs(live_difference.mean) < mean
    assert live_difference.sd < sd


def test_what_was_told_is_written_down_beside_what_was_found() -> None:
    rows = []
    for parameter in LIMITS:
        cues, result, _ = matched(parameter)
        live_difference = result.live_difference
        numbers = f"{live_difference.mean:+.3f} ± {live_difference.sd:.3f}"
        rows.append((parameter, str(len(cues)), str(result.unmatched), str(result.left_out), numbers))
    live_difference = matched("knee_flexion_max_swing_deg")[1].live_difference
    record_in_short(
        "Live cue − final value, knee flexion °",
        "–",
        f"{live_difference.mean:+.3f} ± {live_difference.sd:.3f}",
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
