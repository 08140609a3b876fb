"""Stage results read from one record: later stages take precedence, each notice appears once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.agreement import Agreement
from sagittal.core.errors import Notice, ParameterError
from sagittal.core.events.result import GaitEvents, Strides
from sagittal.core.functional_tests.result import FunctionalTest
from sagittal.core.parameters.measure import MeasuredGait
from sagittal.core.parameters.result import Parameter
from sagittal.core.pipeline.analysis import SCHEMA, DetectedContacts, TakeAnalysis, require_stage
from sagittal.core.pipeline.config import PipelineConfig
from sagittal.core.quality import QualityReport
from sagittal.core.signals.recording import Recording, Subject, UniformRecording

SAID = Notice("said_twice", "Both say so.")


def uniform(rate_hz: float = 100.0, *notices: Notice) -> UniformRecording:
    return UniformRecording(np.arange(5) / rate_hz, rate_hz, {}, Subject(), "walk", {}, notices=notices)


def figure(name: str) -> Parameter:
    return Parameter(name, None, 1, 1.0, None, "s")


def measured(*parameters: Parameter) -> MeasuredGait:
    return MeasuredGait(GaitEvents(()), Strides(()), parameters, {})


EMPTY = TakeAnalysis(Recording({}, {}, sha256={"a.txt": "12ab"}))


def test_a_stage_that_gave_nothing_is_named() -> None:
    assert require_stage(0, "angles") == 0
    with pytest.raises(ParameterError, match="'angles' gave no result") as caught:
        require_stage(None, "angles")
    assert caught.value.code == "stage_not_reached"
    for read in (lambda: EMPTY.recording, lambda: EMPTY.quality):
        with pytest.raises(ParameterError):
            read()


def test_before_any_stage_there_is_nothing() -> None:
    for name in ("calibration", "orientations", "poses", "feet", "events", "strides"):
        assert getattr(EMPTY, name) is None, name
    assert EMPTY.parameters == ()
    assert EMPTY.notices == ()


def test_the_recording_is_the_repaired_one_where_sensors_were_compared() -> None:
    first, repaired = uniform(), uniform(50.0)
    analysis = replace(EMPTY, uniform=first)
    assert analysis.recording is first
    assert replace(analysis, agreed=Agreement(repaired)).recording is repaired


def test_parameters_of_a_functional_test_come_first() -> None:
    test = FunctionalTest(None, None, (), (figure("tug_duration_s"),))
    walk = replace(EMPTY, measured=measured(figure("stride_time_s")))
    assert [p.name for p in walk.parameters] == ["stride_time_s"]
    joint_variant = replace(walk, functional=test)
    assert [p.name for p in joint_variant.parameters] == ["tug_duration_s", "stride_time_s"]
    assert [p.name for p in replace(joint_variant, measured=None).parameters] == ["tug_duration_s"]


def test_squats_speak_for_themselves() -> None:
    assert replace(EMPTY, squats=(), measured=measured(figure("stride_time_s"))).parameters == ()


def test_every_notice_is_told_once_and_the_problem_last() -> None:
    problem = Notice("stopped", "It stopped.", severity="error")
    report = QualityReport("good", (), 0.0, 0.0, {}, (), (Notice("of_quality", "So so."), SAID))
    analysis = replace(
        EMPTY,
        source=replace(EMPTY.source, notices=(SAID,)),
        uniform=uniform(100.0, SAID, Notice("of_axis", "A hole.")),
        report=report,
        contacts=DetectedContacts(GaitEvents((), (Notice("of_events", "None."),)), (), None),
        problem=problem,
        stopped_at="events",
    )
    codes = [n.code for n in analysis.notices]
    assert codes == ["said_twice", "of_axis", "of_quality", "of_events", "stopped"]


def test_where_it_comes_from_is_told() -> None:
    provenance = replace(EMPTY, version="1.2.3").provenance
    assert provenance["input_sha256"] == {"a.txt": "12ab"}
    assert (provenance["version"], provenance["schema"]) == ("1.2.3", SCHEMA)
    assert provenance["parameters_sha256"] == PipelineConfig().digest
