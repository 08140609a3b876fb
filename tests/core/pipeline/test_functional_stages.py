"""Takes of functional tests, whole chain: the protocol decides the recipe; files and report give it back."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from sagittal.core.formats import parse_manifest
from sagittal.core.frames import Protocol
from sagittal.core.pipeline import PipelineConfig, TakeAnalysis, analyse, resume
from sagittal.core.pipeline.functional_stages import measure_trunk_test, measure_walk_test
from sagittal.core.pipeline.recipes import BY_TRUNK, choose_recipe
from sagittal.core.signals.recording import GivenLimits
from sagittal.core.simulate.scripts import ON_SKIN
from sagittal.core.simulate.standing import Sway, simulate_sway
from sagittal.core.simulate.tug import simulate_tug
from sagittal.core.timeline import synchronise
from sagittal.server.report.files.bundle import load_bundle
from sagittal.server.report.files.exports import analysis_files
from sagittal.server.report.view.model import report_model
from tests.helpers.kept import keep


@keep
def analysis() -> TakeAnalysis:
    """All eight sensors are worn; the legs are not used."""
    return analyse(simulate_tug("hemi_mild", 2, setup=ON_SKIN).recording)


@pytest.mark.slow
def test_the_protocol_decides_the_recipe() -> None:
    a = analysis()
    assert a.problem is None
    assert choose_recipe(a) == BY_TRUNK
    assert a.strides is None
    assert a.functional is not None
    assert a.functional.sensor == "pelvis"
    assert {p.name for p in a.parameters if p.mean is None} == set()
    assert all(p.uncertainty for p in a.parameters if p.name.endswith("_s"))


@pytest.mark.slow
def test_files_and_report_give_it_back() -> None:
    a = analysis()
    assert a.functional is not None
    files = analysis_files(a)
    assert set(files) == {"analysis.json", "signals.parquet"}
    report = report_model(load_bundle(files), age=72.0)
    assert [name for name, _ in report.groups] == ["Timed up and go"]
    assert report.quality.word == "Good data"
    assert report.functional is not None
    assert [s.label for s in report.functional.segments][:2] == ["Rising", "Walk out"]
    assert "10.2 s" in report.functional.norm
    assert json.dumps(report.to_json()["functional"])


def test_without_a_trunk_sensor_it_stops_with_a_sentence() -> None:
    a = analyse(simulate_tug(setup=replace(ON_SKIN, worn=("foot_l", "foot_r"))).recording)
    assert a.problem is not None
    assert a.problem.code == "segments_missing"
    assert "pelvis or chest" in a.problem.message


def test_other_limits_of_turns_measure_again_from_the_test_on() -> None:
    a = analysis()
    second_resumed_run = resume(a, "test", PipelineConfig())
    assert [p.mean for p in second_resumed_run.parameters] == [p.mean for p in a.parameters]


def test_standing_with_the_protocol_gives_its_sway() -> None:
    a = analyse(simulate_sway().recording)
    assert a.problem is None
    by_name = {p.name: p.mean for p in a.parameters}
    assert by_name["sway_rms_mps2"] == pytest.approx(simulate_sway().truth["pelvis"].rms, rel=0.05)


def test_the_manifest_carries_what_a_person_said() -> None:
    message = {"protocol": "tug", "test_limits": {"start_s": 3.5, "end_s": 20.0}}
    read = parse_manifest(json.dumps(message).encode())
    assert read.test_limits == GivenLimits(3.5, 20.0)
    assert parse_manifest(b'{"protocol": "tug"}').complete_from(read).test_limits == read.test_limits


def test_without_strides_a_walk_test_has_nothing_to_measure() -> None:
    bare = TakeAnalysis(simulate_sway(Sway(duration_s=5.0)).recording)
    assert measure_walk_test(bare, PipelineConfig()) is bare


@pytest.mark.parametrize(
    ("protocol", "name"),
    [
        ("tug", "tug_duration_s"),
        ("five_sit_to_stand", "five_sit_to_stand_s"),
        ("standing_eyes_open", "sway_rms_mps2"),
    ],
)
def test_each_protocol_of_the_trunk_has_its_own_measures(protocol: Protocol, name: str) -> None:
    """Chair tests of a standing person have no number, with a reason."""
    stood = replace(simulate_sway().recording, protocol=protocol)
    take_analysis = TakeAnalysis(stood, uniform=synchronise(stood))
    functional = measure_trunk_test(take_analysis, PipelineConfig()).functional
    assert functional is not None
    (figure,) = (p for p in functional.parameters if p.name == name)
    assert (figure.mean is None) == (protocol != "standing_eyes_open")
    assert (figure.reason is None) == (protocol == "standing_eyes_open")
