"""The stages that measure a functional test (docs/science/timed-tests.md, docs/science/sway.md)."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from sagittal.core.functional_tests.chair import measure_chair_rises
from sagittal.core.functional_tests.sway import measure_sway
from sagittal.core.functional_tests.trunk import follow_trunk
from sagittal.core.functional_tests.tug import measure_tug
from sagittal.core.functional_tests.walks import measure_six_minutes, measure_ten_metres
from sagittal.core.pipeline.analysis import TakeAnalysis
from sagittal.core.pipeline.config import PipelineConfig
from sagittal.core.pipeline.stages import PipelineStage
from sagittal.core.quality.stuck import drop_stuck_sensors


def measure_trunk_test(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Timed up and go, five times sit-to-stand, or quiet standing, from a trunk sensor."""
    working, protocol = drop_stuck_sensors(analysis.recording), analysis.source.protocol
    limits, params = analysis.source.test_limits, config.functional
    if protocol == "tug":
        test = measure_tug(follow_trunk(working), limits, params.rising, config.turns)
    elif protocol == "five_sit_to_stand":
        test = measure_chair_rises(follow_trunk(working), limits, params.rising)
    else:
        test = measure_sway(working, limits, params.sway)
    return replace(analysis, functional=test)


def measure_walk_test(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Ten-metre or six-minute walk test, from the strides."""
    if analysis.measured is None:
        return analysis
    measure = measure_ten_metres if analysis.source.protocol == "walk_10m" else measure_six_minutes
    limits, params = analysis.source.test_limits, config.functional.walks
    return replace(analysis, functional=measure(analysis.measured, limits, params))


TRUNK_TEST: Final = PipelineStage("test", 0.3, measure_trunk_test, ("functional",), ("functional", "turns"))
WALK_TEST: Final = PipelineStage(
    "test", 0.99, measure_walk_test, ("functional",), ("functional",), runs_after_problem=True
)
