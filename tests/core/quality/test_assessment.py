"""Wrong units and signs are errors, losses and copies are reported, values match the real trial."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.formats import SourceFile, manifest_of, read_recording
from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.quality.assessment import QualityReport, assess, concern_paths_alone
from sagittal.core.rotation import about
from sagittal.core.signals.recording import Recording
from sagittal.core.timeline import synchronise
from tests.core.formats.making import signals, stream, take
from tests.core.formats.test_samples import gaitmap

ACC, GYR = signals(2000, still=500)


def judge(
    acc: Floats, gyr: Floats, *, quat: Floats | None = None, mag: Floats | None = None
) -> QualityReport:
    recording = take({"foot_l": stream("a", acc, gyr, quat=quat, mag=mag)})
    return assess(recording, synchronise(recording))


def errors(report: QualityReport) -> list[str]:
    return [n.code for n in report.notices if n.severity == "error"]


def test_a_sound_take_is_good() -> None:
    report = judge(ACC, GYR)
    assert (report.level, report.reasons, report.notices) == ("good", (), ())
    foot = report.sensors["foot_l"]
    assert foot.rest_norm == pytest.approx(9.81, abs=0.01)
    assert foot.gravity_scale == pytest.approx(9.81 / GRAVITY, abs=0.002)
    assert (foot.lost_pct, foot.gaps, foot.invalid_pct) == (0.0, 0, 0.0)
    assert report.rest[0][0] == 0.0
    assert report.rest[0][1] == pytest.approx(5.0, abs=0.3)


@pytest.mark.parametrize(
    ("acc", "gyr", "code", "words"),
    [
        (ACC / GRAVITY, GYR, "unit_suspect", "it is in g"),
        (ACC * GRAVITY, GYR, "unit_suspect", "96.18"),
        (ACC * 1.4, GYR, "unit_suspect", "13.73"),
        (ACC, np.degrees(GYR), "unit_suspect", "deg/s"),
        (ACC, np.radians(GYR), "unit_suspect", "rad/s but was read as deg/s"),
        (ACC - [0.0, 9.81, 0.0], GYR, "gravity_removed", "FreeAcc"),
        (ACC[600:], np.degrees(GYR[600:]), "unit_suspect", "deg/s"),
        (ACC[600:] / GRAVITY, GYR[600:], "unit_suspect", "g read as m/s²"),
        ((ACC - [0.0, 9.81, 0.0])[600:], GYR[600:], "gravity_removed", "mid-trial"),
    ],
)
def test_signals_that_would_give_wrong_numbers_are_errors(
    acc: Floats, gyr: Floats, code: str, words: str
) -> None:
    report = judge(acc, gyr)
    assert errors(report) == [code]
    assert report.level == "poor"
    (message,) = [n.message for n in report.notices if n.severity == "error"]
    assert words in message
    assert "Sensor a" in message


def test_a_scale_a_little_off_is_only_a_warning() -> None:
    report = judge(ACC * 1.15, GYR)
    assert errors(report) == []
    assert [(n.code, n.severity) for n in report.notices] == [("unit_suspect", "warning")]
    assert report.level == "usable"
    assert judge(ACC * 1.06, GYR).level == "good"


def test_a_reversed_sign_is_found_with_the_vendor_orientation() -> None:
    quat = np.tile(about(0, np.pi / 2), (len(ACC), 1))
    assert errors(judge(ACC, GYR, quat=quat)) == []
    assert errors(judge(-ACC, GYR, quat=quat)) == ["gravity_sign"]


def test_a_take_without_rest_is_said() -> None:
    report = judge(ACC[600:], GYR[600:])
    assert [(n.code, n.severity) for n in report.notices] == [("no_rest", "info")]
    assert report.sensors["foot_l"].rest_norm is None
    assert report.sensors["foot_l"].gyro_bias is None


def test_clipping_beyond_a_thousandth_is_a_warning() -> None:
    acc = ACC + np.where(np.arange(2000) % 100 < 3, 400.0, 0.0)[:, None] * (np.arange(2000) > 600)[:, None]
    report = judge(np.clip(acc, -160.0, 160.0), GYR)
    assert [(n.code, n.severity) for n in report.notices] == [("saturated", "warning")]
    assert report.sensors["foot_l"].acc_saturated_pct > 1.0


def test_losses_and_holes_are_counted() -> None:
    keep = np.ones(2000, bool)
    keep[1000:1005] = False
    keep[1200:1400] = False
    acc, gyr = signals(2000, still=500)
    s = stream("a", acc[keep], gyr[keep], t_s=np.flatnonzero(keep) / 100.0)
    recording = take({"foot_l": s})
    report = assess(recording, synchronise(recording))
    foot = report.sensors["foot_l"]
    assert foot.lost_pct == pytest.approx(10.25)
    assert foot.longest_gap_s == pytest.approx(2.0)
    assert foot.gaps == 2
    assert foot.interpolated_pct == pytest.approx(0.25)
    assert foot.invalid_pct == pytest.approx(10.0)
    assert [(n.code, n.sensor, n.t_s) for n in report.notices] == [("gap", "foot_l", 12.0)]
    assert report.level == "usable"


def test_a_sensor_that_stopped_early_is_not_reported_again_as_a_gap() -> None:
    acc, gyr = signals(2000, still=500)
    keep = np.ones(800, np.bool_)
    keep[300:500] = False
    for rows, gaps in ((np.flatnonzero(keep), ["10.0 %"]), (np.arange(800), [])):
        short = stream("b", acc[rows] + 1.0, gyr[rows], t_s=rows / 100.0)
        recording = take(
            {"foot_l": stream("a", acc, gyr), "pelvis": stream("c", acc + 2.0, gyr), "shank_l": short}
        )
        uniform = synchronise(recording)
        assert [n.code for n in uniform.notices] == ["unequal_lengths"]
        text = [n.message for n in assess(recording, uniform).notices if n.code == "gap"]
        assert len(text) == len(gaps)
        assert all(share in message for share, message in zip(gaps, text, strict=True))


@pytest.mark.parametrize(("lost_s", "told"), [(0.07, False), (0.3, True)])
def test_the_end_that_a_late_clock_leaves_empty_is_told_from_a_tenth_of_a_second_on(
    lost_s: float, told: bool
) -> None:
    acc, gyr = signals(2000, still=500)
    recording = take({"foot_l": stream("a", acc, gyr)})
    uniform = synchronise(recording)
    foot = uniform.sensors["foot_l"]
    late = replace(foot, valid=foot.valid & (uniform.t_s >= lost_s))
    report = assess(recording, replace(uniform, sensors={"foot_l": late}))
    messages = [n.message for n in report.notices if n.code == "gap"]
    assert len(messages) == told
    assert all("1 gap of at least 0.1 s" in m and f"{lost_s:.2f} s" in m for m in messages)


def test_errors_of_the_reader_stop_the_analysis_only_for_worn_sensors() -> None:
    silent = read_recording(
        [SourceFile.of_bytes("t.csv", b"1,2,3,4,5,6\n" * 600)],
        manifest_of(
            {
                "sources": [
                    {
                        "file": "t.csv", "header_rows": 0, "rate_hz": 100, "acc_unit": "m/s2",
                        "gyr_unit": "rad/s",
                        "gravity_included": False,
                        "columns": {"foot_l": {"acc": ["1", "2", "3"], "gyr": ["4", "5", "6"]}},
                    }
                ]
            }
        ),
    )  # fmt: skip
    assert "gravity_removed" in errors(assess(silent, synchronise(silent)))
    spare = Recording(
        {**silent.streams, "a": stream("a", ACC, GYR, clock="index")}, {"a": "pelvis", "foot_l": None}
    )
    assert errors(assess(spare, synchronise(spare))) == []


@pytest.mark.recorded
def test_the_real_take_has_the_figures_of_the_specification(neura: Recording) -> None:
    """Rest norm 9.83 to 9.95, magnetic shares .00 .08/.30 .37/.36
    (docs/science/quality.md, "Magnetic field")."""
    report = assess(neura, synchronise(neura))
    shares = {k: s.magnetic_pct for k, s in report.sensors.items()}
    expected = {"pelvis": 0, "thigh_l": 0, "thigh_r": 0, "shank_l": 8, "shank_r": 30, "foot_l": 37}
    expected["foot_r"] = 36
    assert shares == {k: pytest.approx(v, abs=1.0) for k, v in expected.items()}
    norms = [s.rest_norm for s in report.sensors.values() if s.rest_norm is not None]
    assert len(norms) == 7
    assert min(norms) > 9.82
    assert max(norms) < 9.96
    assert report.level == "good"
    assert report.rest[0][1] > 10.5
    assert [n.severity for n in report.notices if n.code == "duplicate_stream"] == ["info", "info"]
    assert errors(report) == []


@pytest.mark.recorded
def test_the_report_is_plain_json(neura: Recording) -> None:
    text = json.dumps(assess(neura, synchronise(neura)).to_json(), allow_nan=False)
    assert json.loads(text)["sensors"][0]["segment"] == "pelvis"


@pytest.mark.recorded
def test_the_raw_gaitmap_copy_shows_its_clipped_heel_strikes() -> None:
    """Heel strikes clip at ±16 g (docs/science/quality.md, "Range"): found in the copy whose axes were not
    rotated."""
    recording = gaitmap("imu_sample_not_rotated.csv")
    report = assess(recording, synchronise(recording))
    assert {(n.code, n.severity) for n in report.notices} == {("saturated", "info")}
    assert report.level == "good"


@pytest.mark.parametrize(
    ("bad", "alone"),
    [
        ([], False),
        (["zero_velocity_refused_pct"], True),
        (["zero_velocity_refused_pct", "climb_pct"], True),
        (["zero_velocity_refused_pct", "joint_residual_mm"], False),
        (["start_heading_off_deg"], False),
    ],
)
def test_the_path_of_one_foot_is_no_disagreement_of_sensors(bad: list[str], alone: bool) -> None:
    assert concern_paths_alone(bad) is alone
