"""Records are read back unchanged; invalid ones are refused with a message."""

from __future__ import annotations

import json
from typing import Any

import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.feedback import Baseline, Cue, Prescription, Tone
from sagittal.core.parameters.catalogue import CATALOGUE, list_curve_figures, list_trainable
from sagittal.core.parameters.catalogue.entry import PHASES, SUPPORT, TIMING
from sagittal.core.parameters.kinematic import FOOT_PITCH
from sagittal.core.parameters.spatial import NAMES as SPATIAL
from tests.helpers.feedback import prescription


def record(**changes: Any) -> dict[str, Any]:
    data: dict[str, Any] = json.loads(json.dumps(prescription().to_json()))
    for name, value in changes.items():
        if isinstance(value, dict):
            data[name] |= value
        else:
            data[name] = value
    return data


def test_a_record_survives_json() -> None:
    result = prescription(
        modes=["zone", "tone"], schedule={"kind": "fading", "shares_pct": [100, 75, 0], "probe_every": 30}
    )
    assert Prescription.from_json(json.loads(json.dumps(result.to_json()))) == result


def test_what_is_left_out_has_its_default() -> None:
    result = Prescription.from_json({"parameter": "stance_pct", "side": "right"})
    assert result.target.source == "norm"
    assert result.schedule.shares_pct == (100, 50, 0)
    assert (result.progression.window, result.progression.share, result.progression.sd_per_level) == (
        20,
        0.7,
        1.0,
    )


def test_every_parameter_of_a_stride_can_be_trained() -> None:
    times = {n for n, e in CATALOGUE.items() if e.of == "stride" and e.group in {TIMING, PHASES, SUPPORT}}
    assert set(list_trainable()) == {*SPATIAL, *times, *list_curve_figures(), *FOOT_PITCH}


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"parameter": "beauty"}, "prescription.parameter is 'beauty'. Expected one of gait_speed_mps"),
        (record(side="both"), "prescription.side is 'both'. Expected one of left, right, null"),
        (record(modes=[]), "prescription.modes is []. Expected a list of at least one of bar"),
        (record(modes=["smell"]), "prescription.modes is ['smell']"),
        (record(band_sd=0), "prescription.band_sd is 0. Expected a number from 0.1 to 5"),
        (record(band_sd=float("nan")), "prescription.band_sd is nan. Expected a number"),
        (record(band_sd=True), "prescription.band_sd is True. Expected a number"),
        (record(positive_only=True, bandwidth=True), "Expected at most one"),
        (record(target={"sd": None}), "target.mean is 0.6 and target.sd None. Expected both"),
        (record(target={"sd": 0.0}), "target.sd is 0. Expected more than 0"),
        (record(target={"sd": -1}), "target.sd is -1. Expected more than 0"),
        (record(target={"mean": None, "sd": None}), "Expected both numbers"),
        (record(side=None, target={"source": "own_better_side"}), "Expected side left or right"),
        (record(schedule={"shares_pct": [50, 100]}), "Expected no share above the one before"),
        (record(schedule={"shares_pct": [100, 50.5]}), "whole percents from 0 to 100"),
        (record(schedule={"shares_pct": []}), "whole percents from 0 to 100"),
        (record(schedule={"strides_per_share": 0}), "strides_per_share is 0. Expected a whole number from 1"),
        (record(progression={"share": 0.3, "away_share": 0.5}), "Expected a sum of at least 1"),
        (record(progression={"start_level": 21}), "start_level is 21. Expected a whole number from 0 to 20"),
        (record(progression={"automatic": None}), "automatic is None. Expected true or false"),
        (record(stop_rule={"max_minutes": "long"}), "max_minutes is 'long'. Expected a number"),
        (record(guard={"colour": "red"}), "guard has colour. Expected only gps_rise_deg, other_change"),
        (record(haste=1), "prescription has haste. Expected only"),
        (record() | {"target": [1]}, "target is [1]. Expected an object"),
        ("text", "prescription is 'text'. Expected an object"),
    ],
)  # fmt: skip
def test_a_record_that_makes_no_sense_is_refused(data: Any, said: str) -> None:
    with pytest.raises(ParameterError) as refused:
        Prescription.from_json(data)
    assert refused.value.code == "bad_prescription"
    assert said in refused.value.message


def test_a_baseline_and_a_cue_survive_json() -> None:
    reference = Baseline(0.4, 0.03, 40, "before", 3, 0.067, "Kesar", after_training=True)
    assert Baseline.from_json(json.loads(json.dumps(reference.to_json()))) == reference
    cue = Cue(
        3, "left", 1.5, 2.5, 0.4, -4.0, "low", shown=True, why_not=None, level=1, zone_low=0.5,
        zone_high=0.65, tone=Tone(880.0, 1.0), block=2, share_in_zone_last20=0.25,
    )  # fmt: skip
    assert Cue.from_json(json.loads(json.dumps(cue.to_json()))) == cue
