"""Quality: wrong units and signs are errors, losses and copies are said, figures agree with the real take."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from core.formats import SourceFile, manifest_of, read_recording
from core.frames import GRAVITY, Floats, Segment
from core.quality import QualityReport, assess, concern_paths_alone, describe, suggest, suggest_segments
from core.quality.signals import magnetic_share, measure_signal, measure_stream, saturation
from core.recording import ImuStream, Recording
from core.rotation import about
from core.simulate import simulate_scenario
from core.timeline import synchronise
from tests.core.formats.making import signals, stream, take
from tests.core.formats.test_samples import gaitmap
from tests.data import ROOT, data_folder

NEURA: dict[str, Segment | None] = {
    "00B40B91": "pelvis", "00B40C45": "thigh_l", "00B40C3C": "thigh_r", "00B40BA5": "shank_l",
    "00B40C35": "shank_r",
    "00B40C55": "foot_l", "00B40C48": "foot_r", "00B40C44": None, "00B40C47": None,
}  # fmt: skip
ACC, GYR = signals(2000, still=500)


@pytest.fixture(scope="module")
def neura() -> Recording:
    folder = data_folder("neura_walk", "rawimu")
    return read_recording(
        [SourceFile.of_path(p) for p in sorted(folder.iterdir())], manifest_of({"sensors": dict(NEURA)})
    )


def judge(
    acc: Floats, gyr: Floats, *, quat: Floats | None = None, mag: Floats | None = None
) -> QualityReport:
    recording = take({"foot_l": stream("a", acc, gyr, quat=quat, mag=mag)})
    return assess(recording, synchronise(recording))


def errors(report: QualityReport) -> list[str]:
    return [n.code for n in report.notices if n.severity == "error"]


def test_a_trunk_that_turns_slowly_is_no_rest_with_the_wrong_unit() -> None:
    """Its force is calm for a second in which it turns by 15 °/s: seen in a walk without standing."""
    t = np.arange(1000) / 100.0
    acc = np.array([0.0, 9.81, 0.0]) + 0.05 * np.sin(2 * np.pi * 1.8 * t)[:, None]
    gyr = np.zeros((1000, 3))
    gyr[:, 1] = 0.4 + 0.3 * np.sin(2 * np.pi * 0.9 * t)
    assert measure_signal(acc, gyr, 100.0).still_gyro is None
    rng = np.random.default_rng(0)
    biased = np.full((1000, 3), 0.3) + 0.05 * rng.standard_normal((1000, 3))
    assert measure_signal(acc, biased, 100.0).still_gyro == pytest.approx(0.53, abs=0.05)


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
        ((ACC - [0.0, 9.81, 0.0])[600:], GYR[600:], "gravity_removed", "middle"),
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


def test_clipping_is_a_plateau_not_a_peak() -> None:
    rng = np.random.default_rng(1)
    x = rng.normal(0, 60, (5000, 3))
    assert saturation(x, 18.0) == (0.0, None)
    slow = np.stack([200 * np.sin(np.arange(5000) / 50)] * 3, axis=1)
    share, top = saturation(np.clip(slow, -156.9, 156.9), 18.0)
    assert top == pytest.approx(156.9)
    assert share == pytest.approx(np.mean(np.abs(slow[:, 0]) >= 156.9), abs=0.01)
    assert saturation(np.clip(slow, -10, 10), 18.0) == (0.0, None)


def test_clipping_beyond_a_thousandth_is_a_warning() -> None:
    acc = ACC + np.where(np.arange(2000) % 100 < 3, 400.0, 0.0)[:, None] * (np.arange(2000) > 600)[:, None]
    report = judge(np.clip(acc, -160.0, 160.0), GYR)
    assert [(n.code, n.severity) for n in report.notices] == [("saturated", "warning")]
    assert report.sensors["foot_l"].acc_saturated_pct > 1.0


def test_the_magnetic_share_counts_from_the_norm_at_rest() -> None:
    mag = np.tile([0.3, 0.4, 0.0], (1000, 1))
    mag[600:800] *= 1.2
    mag[900:950] = np.nan
    assert magnetic_share(mag, slice(0, 100), 0.1) == pytest.approx(200 / 950)
    assert magnetic_share(mag, slice(900, 950), 0.1) is None


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
        said = [n.message for n in assess(recording, uniform).notices if n.code == "gap"]
        assert len(said) == len(gaps)
        assert all(share in message for share, message in zip(gaps, said, strict=True))


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
    assert all("1 stretch of 0.1 s and more" in m and f"{lost_s:.2f} s" in m for m in messages)


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


def test_facts_survive_short_and_holed_signals() -> None:
    acc = np.full((5, 3), np.nan)
    acc[2] = [0.0, 0.0, 9.81]
    f = measure_signal(acc, None, 100.0)
    assert f.still_norm == pytest.approx(9.81)
    assert f.gyro_top is None


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
def test_the_upload_page_learns_what_the_real_files_hold(neura: Recording) -> None:
    unmapped = Recording(neura.streams, {})
    found = describe(unmapped)
    text = json.dumps(found.to_json(), allow_nan=False)
    assert "NaN" not in text
    copies = {d.device_id: d.duplicate_of for d in found.devices if d.duplicate_of}
    assert copies == {"00B40C49": "00B40C44", "00B40C4A": "00B40C47"}
    assert all(d.lost_pct == 0.0 and d.has_gyro and d.has_mag and d.rate_hz == 100.0 for d in found.devices)
    assert found.duration_s == pytest.approx(25.02)


def nameless(recording: Recording) -> tuple[Recording, dict[str, Segment]]:
    """The same sensors without any name or mapping, and what they truly are."""
    ids = {d: f"id{i}" for i, d in enumerate(recording.streams)}
    streams = {ids[d]: replace(s, device_id=ids[d], source="x") for d, s in recording.streams.items()}
    return Recording(streams, {}), {ids[d]: s for d, s in recording.segments.items() if s}


@pytest.mark.recorded
def test_movement_sorts_nine_real_sensors_and_sets_ankles_and_copies_aside(neura: Recording) -> None:
    segments = suggest_segments(Recording(neura.streams, {}))
    assert segments == {d: NEURA.get(d) for d in neura.streams}


@pytest.mark.sweep
@pytest.mark.parametrize("script", ["comfortable", "fast_with_turns", "slow"])
def test_movement_tells_segments_and_sides_of_simulated_walks(script: str) -> None:
    recording, truth = nameless(simulate_scenario(script, seed=1).recording)
    assert suggest_segments(recording) == truth


@pytest.mark.recorded
def test_a_walk_without_rest_before_it_has_legs_but_no_sides(neura: Recording) -> None:
    walk = slice(1250, 2150)
    cut = {
        d: replace(
            s,
            t_s=s.t_s[walk],
            acc=s.acc[walk],
            gyr=None if s.gyr is None else s.gyr[walk],
            mag=None,
            quat=None,
        )
        for d, s in neura.streams.items()
    }
    found = suggest(Recording(cut, {}))
    assert {s.segment for s in found.values()} == {None, "pelvis"}
    parts = {d: (s.part, s.leg) for d, s in found.items()}
    assert {parts[d][0] for d in ("00B40C55", "00B40C48")} == {"foot"}
    legs = {(parts[d][1], segment[-1]) for d, segment in NEURA.items() if segment and "_" in segment}
    assert len(legs) == 2


@pytest.mark.recorded
def test_movement_says_nothing_about_people_who_stand(neura: Recording) -> None:
    still = {
        d: ImuStream(
            d, s.source, s.t_s[:1000], s.acc[:1000], None if s.gyr is None else s.gyr[:1000], None, None,
            100.0, "counter", d,
        )
        for d, s in neura.streams.items()
    }  # fmt: skip
    assert set(suggest_segments(Recording(still, {})).values()) == {None}


def test_names_are_believed_before_movement() -> None:
    names = ("LTibia_2021", "Pelvis", "box", "pelvis 2")
    streams = {name: stream(name, ACC + i, GYR) for i, name in enumerate(names)}
    segments = suggest_segments(Recording(streams, {}))
    assert segments == {"LTibia_2021": "shank_l", "Pelvis": None, "box": None, "pelvis 2": None}
    streams.pop("pelvis 2")
    assert suggest_segments(Recording(streams, {}))["Pelvis"] == "pelvis"


@pytest.mark.recorded
def test_a_declared_mapping_is_kept_as_the_suggestion(neura: Recording) -> None:
    found = suggest(neura)
    assert {found[d].segment for d in NEURA} == set(NEURA.values())
    assert found["00B40C55"].basis == "declared"


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


def test_turning_on_the_spot_while_the_trunk_is_level_is_no_wrong_unit() -> None:
    """mobgap_lowback Test5: the quietest second of the accelerometer lies in a turn."""
    still = np.tile([0.0, 0.0, GRAVITY], (1000, 1))
    acc = still + np.random.default_rng(0).normal(0.0, 0.05, still.shape)
    acc[400:600] = still[400:600]
    gyr = np.full(still.shape, 0.02)
    gyr[400:600, 2] = 0.8
    assert measure_signal(acc, gyr, 100.0).still_gyro == pytest.approx(0.02 * 3**0.5)
    everywhere = np.full(still.shape, 1.0)
    assert measure_signal(acc, everywhere, 100.0).still_gyro == pytest.approx(3**0.5)


@pytest.mark.slow
@pytest.mark.parametrize("until_s", [6.0, np.inf], ids=["before the walk", "all the time"])
def test_a_pelvis_without_any_acceleration_is_described_all_the_same(until_s: float) -> None:
    """Which leg is the left one is read from the pelvis."""
    recording = simulate_scenario("comfortable", 0).recording
    streams = {}
    for i, (device, segment) in enumerate(recording.segments.items()):
        s = recording.streams[device]
        none = (s.t_s < until_s) & (segment == "pelvis")
        acc = np.where(none[:, None], 0.0, s.acc)
        streams[f"s{i}"] = replace(s, device_id=f"s{i}", source="x", acc=acc)
    found = describe(Recording(streams, {}))
    assert "gravity_removed" in [n.code for d in found.devices for n in d.notices]
    assert json.dumps(found.to_json(), allow_nan=False)


def test_infinite_samples_are_no_plateau() -> None:
    acc = ACC.copy()
    acc[100:110] = np.inf
    assert saturation(acc, 10.0) == (0.0, None)


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


def test_two_sensors_that_name_their_side_alone_are_taken_for_the_feet() -> None:
    pair = Recording({d: stream(d, ACC, GYR) for d in ("left_sensor", "right_sensor")}, segments={})
    assert suggest_segments(pair) == {"left_sensor": "foot_l", "right_sensor": "foot_r"}
    for devices in (("left_a", "left_b"), ("left_a", "right_b", "c"), ("a", "b")):
        assert set(
            suggest_segments(Recording({d: stream(d, ACC, GYR) for d in devices}, segments={})).values()
        ) == {None}


@pytest.mark.slow
def test_a_table_is_judged_without_a_compiler() -> None:
    """The web process does: numba would cost it seconds and memory."""
    code = "import sys, numpy as np; from core.quality.signals import measure_signal; "
    code += "measure_signal(np.ones((200, 3)), np.zeros((200, 3)), 100.0); sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0


def test_a_stream_is_measured_once() -> None:
    one = stream("a", ACC, GYR)
    facts = measure_stream(one)
    assert facts == measure_signal(one.acc, one.gyr, one.rate_hz)
    assert measure_stream(one) is facts
    assert measure_stream(stream("a", 2.0 * ACC, GYR)) != facts
