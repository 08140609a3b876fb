"""The chain resumed from a stage gives identical bits."""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Any

import numpy as np
import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.events.flags import StrideParams
from sagittal.core.frames import Segment
from sagittal.core.pipeline import TRUNK_ONLY, WALK, PipelineConfig, TakeAnalysis, analyse, resume
from sagittal.core.signals.recording import Recording
from sagittal.core.simulate import simulate_scenario

OTHER = PipelineConfig(strides=StrideParams(edge_strides=2))


@cache
def take(*segments: Segment) -> Recording:
    return simulate_scenario("comfortable", 1, worn=segments or None).recording


@cache
def whole(*segments: Segment) -> TakeAnalysis:
    return analyse(take(*segments))


def same(x: Any, y: Any) -> bool:
    """Equal to the bit, arrays and all."""
    if isinstance(x, np.ndarray):
        return x.dtype == y.dtype and np.array_equal(x, y, equal_nan=x.dtype.kind == "f")
    if dataclasses.is_dataclass(x) and not isinstance(x, type):
        return type(x) is type(y) and all(same(getattr(x, f.name), getattr(y, f.name)) for f in fields(x))
    if hasattr(x, "items"):
        return list(x) == list(y) and all(same(x[k], y[k]) for k in x)
    if isinstance(x, list | tuple):
        return len(x) == len(y) and all(same(a, b) for a, b in zip(x, y, strict=True))
    return bool(x == y) or (x != x and y != y)


def fields(x: Any) -> tuple[Any, ...]:
    return dataclasses.fields(x)


@pytest.mark.slow
def test_the_comparison_sees_a_bit() -> None:
    a = whole("pelvis")
    assert a.uniform is not None
    later = dataclasses.replace(a.uniform, t_s=np.nextafter(a.uniform.t_s, 99.0))
    assert same(a, a)
    assert not same(a, dataclasses.replace(a, uniform=later))


@pytest.mark.slow
@pytest.mark.parametrize("stage", [s.name for s in WALK])
def test_resumed_at_any_stage_is_the_whole(stage: str) -> None:
    segments: tuple[Segment, ...] = ("pelvis", "foot_l", "foot_r")
    assert whole(*segments).problem is None
    assert same(resume(whole(*segments), stage), whole(*segments))


@pytest.mark.slow
def test_an_analysis_that_nobody_resumes_lets_go_of_earlier_orientations_and_finds_the_same() -> None:
    segments: tuple[Segment, ...] = ("pelvis", "foot_l", "foot_r")
    result, retained = analyse(take(*segments), resumable=False), whole(*segments)
    for name in ("posed", "angles", "tracks", "measured", "calibration", "notices"):
        assert same(getattr(result, name), getattr(retained, name)), name
    assert retained.fused is not None
    assert result.fused is not None
    assert set(result.fused.q) == {"foot_l", "foot_r"} < set(retained.fused.q)
    assert result.mounted is not None
    assert result.posed is not None
    assert result.mounted.orientations is result.posed.orientations
    for analysis, target in ((result, False), (retained, True)):
        streams, sensors = analysis.source.streams.values(), analysis.recording.sensors.values()
        assert {x.mag is not None for x in streams} == {target} == {x.mag is not None for x in sensors}


@pytest.mark.sweep
def test_seven_sensors_resumed_where_their_mountings_are_found_are_the_whole() -> None:
    assert same(resume(whole(), "mounting"), whole())


@pytest.mark.slow
@pytest.mark.parametrize("stage", [s.name for s in TRUNK_ONLY])
def test_a_trunk_sensor_resumed_at_any_stage_is_the_whole(stage: str) -> None:
    assert same(resume(whole("pelvis"), stage), whole("pelvis"))


@pytest.mark.slow
def test_with_other_parameters_it_is_what_the_chain_gives_with_those() -> None:
    segments: tuple[Segment, ...] = ("pelvis", "foot_l", "foot_r")
    second_resumed_run = resume(whole(*segments), "parameters", OTHER)
    assert same(second_resumed_run, analyse(take(*segments), OTHER))
    assert second_resumed_run.provenance != whole(*segments).provenance
    assert second_resumed_run.strides != whole(*segments).strides


def test_parameters_of_an_earlier_stage_cannot_be_changed_on_the_way() -> None:
    second = PipelineConfig(detector="consensus")
    with pytest.raises(ParameterError, match="detector belong to stages before 'poses'") as caught:
        resume(whole("pelvis", "foot_l", "foot_r"), "poses", second)
    assert caught.value.code == "earlier_parameters"


def test_a_stage_that_does_not_exist_is_named() -> None:
    with pytest.raises(
        ParameterError, match="No stage 'squat'; expected one of timeline, agreement, quality"
    ) as caught:
        resume(whole("pelvis"), "squat")
    assert caught.value.code == "unknown_stage"


def test_progress_tells_the_stages_that_run() -> None:
    names: list[str] = []
    resume(whole("pelvis", "foot_l", "foot_r"), "poses", progress=lambda stage, share: names.append(stage))
    assert names == ["poses", "angles", "parameters", "done"]


def test_after_a_problem_only_what_was_reached_is_measured_again() -> None:
    config = PipelineConfig()
    config = dataclasses.replace(config, poses=dataclasses.replace(config.poses, estimator="erkf"))
    stopped = analyse(take("pelvis", "foot_l", "foot_r"), config)
    assert stopped.problem is not None
    assert stopped.problem.code == "estimator_impossible"
    assert stopped.stopped_at == "mounting"
    assert stopped.strides is not None
    assert same(resume(stopped, "parameters"), stopped)
    assert same(resume(stopped, "mounting"), stopped)
    with pytest.raises(ParameterError, match="mounting gave no result") as caught:
        resume(stopped, "poses")
    assert caught.value.code == "stage_not_reached"
    mended = resume(stopped, "mounting", PipelineConfig())
    assert same(mended, whole("pelvis", "foot_l", "foot_r"))
