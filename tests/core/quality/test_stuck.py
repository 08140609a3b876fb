"""Channels that do not measure are found, named and left out; sensors that measure never are."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.io import loadmat

from sagittal.core.errors import Notice
from sagittal.core.formats import SourceFile, read_recording
from sagittal.core.frames import GRAVITY, Floats, Segment
from sagittal.core.pipeline import TakeAnalysis, analyse
from sagittal.core.quality.stuck import CODES, StuckWatch, drop_stuck_sensors, mark_stuck
from sagittal.core.signals.recording import ImuStream, Recording, SensorSignals, Subject, UniformRecording
from sagittal.core.simulate import SCRIPTS, simulate_scenario
from sagittal.core.timeline import synchronise
from tests.core.formats.making import stream, take
from tests.data import data_folder
from tests.helpers import gaitmap, mobgap
from tests.helpers.live_walks import live
from tests.helpers.marks import sweep_after
from tests.helpers.walks import cut, neura_walk, simulated

Spoil = Callable[[Floats, Floats, int], None]
"""Changes acc, gyr (n, 3) in place from sample k on."""


def told(notices: tuple[Notice, ...]) -> list[tuple[str, str | None]]:
    return [(n.code, n.sensor) for n in notices if n.code in CODES]


def spoilt(recording: UniformRecording, segment: Segment, spoil: Spoil, at_s: float) -> UniformRecording:
    was = recording.sensors[segment]
    acc, gyr = was.acc.copy(), was.gyr.copy()
    spoil(acc, gyr, round(at_s * recording.rate_hz))
    return replace(recording, sensors={**recording.sensors, segment: replace(was, acc=acc, gyr=gyr)})


def dead_gyroscope(acc: Floats, gyr: Floats, k: int) -> None:
    gyr[k:] = 0.0


def dead_axis(acc: Floats, gyr: Floats, k: int) -> None:
    gyr[k:, 1] = 0.013


def stuck_accelerometer(acc: Floats, gyr: Floats, k: int) -> None:
    acc[k:] = (0.0, 9.8, 0.0)


def no_acceleration(acc: Floats, gyr: Floats, k: int) -> None:
    acc[k:] = 0.0


def frozen(acc: Floats, gyr: Floats, k: int) -> None:
    acc[k:], gyr[k:] = acc[k], gyr[k]


def flickering(acc: Floats, gyr: Floats, k: int) -> None:
    """An axis that shows a new value every tenth sample only."""
    acc[k:, 2] = np.repeat(acc[k::10, 2], 10)[: len(acc) - k]


def looped(acc: Floats, gyr: Floats, k: int) -> None:
    """The last packet of 20 samples, again and again."""
    second = k + np.arange(len(acc) - k) % 20
    acc[k:], gyr[k:] = acc[second], gyr[second]


def narrow(acc: Floats, gyr: Floats, k: int) -> None:
    """A range that the movement leaves with every stride for a tenth of a second and more."""
    limit = np.radians(250.0)
    gyr[k:] = np.clip(gyr[k:], -limit, limit)


FAULTS: list[tuple[Spoil, str]] = [
    (dead_gyroscope, "channel_stuck"), (dead_axis, "channel_stuck"), (stuck_accelerometer, "channel_stuck"),
    (no_acceleration, "channel_stuck"), (flickering, "channel_stuck"), (frozen, "sensor_frozen"),
    (looped, "samples_repeated"), (narrow, "channel_clipped"),
]  # fmt: skip


@cache
def comfortable() -> UniformRecording:
    return simulated("comfortable")[0]


@pytest.mark.sweep
@pytest.mark.parametrize("segment", ["pelvis", "thigh_l", "foot_r"])
@pytest.mark.parametrize(("spoil", "code"), FAULTS, ids=lambda x: getattr(x, "__name__", ""))
def test_a_sensor_that_does_not_measure_is_named_and_left_out_from_there(
    spoil: Spoil, code: str, segment: Segment
) -> None:
    if spoil is narrow and segment != "foot_r":
        pytest.skip("only feet turn that fast")
    for at_s in (0.0,) if spoil is narrow else (0.0, 21.0):
        # the walk begins at 6 s; who repeats the last packet before it stands still
        at_s = 8.0 if spoil in (frozen, looped) and at_s == 0.0 else at_s
        stuck = mark_stuck(spoilt(comfortable(), segment, spoil, at_s))
        assert told(stuck.notices) == [(code, segment)]
        (notice,) = (n for n in stuck.notices if n.code == code)
        assert len(notice.message.split()) <= 27
        valid = stuck.sensors[segment].valid
        first = round(at_s * stuck.rate_hz)
        begun = int(np.argmin(valid))
        # of a range, or of a new value now and then, nothing tells before somebody moves
        late = spoil in (narrow, flickering)
        assert first - 1 <= begun <= (max(first, 600) + 300 if late else first + 30)
        assert not valid[begun + 1 :].any()
        assert all(x.valid.all() for s, x in stuck.sensors.items() if s != segment)
        assert (segment in drop_stuck_sensors(stuck).sensors) == (at_s > 0.5 * stuck.t_s[-1])


def test_a_sensor_that_repeats_a_sample_for_a_while_is_there_again_with_the_next_new_one() -> None:
    def pause(acc: Floats, gyr: Floats, k: int) -> None:
        acc[k : k + 150], gyr[k : k + 150] = acc[k], gyr[k]

    stuck = mark_stuck(spoilt(comfortable(), "shank_r", pause, 20.0))
    valid = stuck.sensors["shank_r"].valid
    assert told(stuck.notices) == [("sensor_frozen", "shank_r")]
    assert 2000 <= np.flatnonzero(~valid)[0] <= 2002
    assert np.count_nonzero(~valid) == pytest.approx(150, abs=2)
    assert "shank_r" in drop_stuck_sensors(stuck).sensors


def test_any_division_into_blocks_finds_the_same() -> None:
    recording = comfortable()
    for segment, (spoil, _) in zip(recording.sensors, FAULTS, strict=False):
        recording = spoilt(recording, segment, spoil, 15.0)
    x = list(recording.sensors.values())
    acc, gyr, valid = (np.stack([getattr(s, n) for s in x], axis=1) for n in ("acc", "gyr", "valid"))
    whole = StuckWatch(len(x), recording.rate_hz).push(acc, gyr, valid)
    assert whole is not None
    assert whole[0].any(axis=0).sum() >= 6
    watch = StuckWatch(len(x), recording.rate_hz)
    edges = np.unique(np.random.default_rng(0).integers(0, len(acc), 300))
    parts = []
    for a, b in zip([0, *edges], [*edges, len(acc)], strict=True):
        frame = watch.push(acc[a:b], gyr[a:b], valid[a:b])
        parts.append(frame or (np.zeros((b - a, len(x)), np.int64),) * 2)
    for ours, theirs in zip(whole, zip(*parts, strict=True), strict=True):
        np.testing.assert_array_equal(ours, np.concatenate(theirs))


def of_arrays(rate_hz: float, sensors: dict[str, tuple[Floats, Floats]]) -> UniformRecording:
    """Sensors under their own names, since this rule ignores placement."""
    n = min(len(acc) for acc, _ in sensors.values())
    mask = np.ones(n, np.bool_)
    signals = {
        s: SensorSignals(
            s, np.ascontiguousarray(a[:n]), np.ascontiguousarray(g[:n]), None, mask.copy(), ~mask
        )
        for s, (a, g) in sensors.items()
    }
    return UniformRecording(np.arange(n) / rate_hz, rate_hz, signals, Subject(), "walk", {})  # type: ignore[arg-type]


def coarse(recording: UniformRecording, acc: float, gyr: float) -> UniformRecording:
    """The same take from sensors with steps of acc m/s² and gyr rad/s."""
    sensors = {
        s: replace(x, acc=np.round(x.acc / acc) * acc, gyr=np.round(x.gyr / gyr) * gyr)
        for s, x in recording.sensors.items()
    }
    return replace(recording, sensors=sensors)


def ipol() -> list[UniformRecording]:
    folder = data_folder("ipol_walks")
    walks = []
    for first in sorted(folder.glob("*_lf.txt")):
        name = first.name.removesuffix("_lf.txt")
        rows = {k: np.genfromtxt(folder / f"{name}_{k}.txt", skip_header=2) for k in ("lf", "rf", "lb")}
        walks.append(of_arrays(100.0, {k: (x[:, 1:4], x[:, 4:7]) for k, x in rows.items()}))
    return walks


def qmt() -> list[UniformRecording]:
    data = loadmat(
        data_folder("qmt_fullbody") / "full_body_example_data.mat", squeeze_me=True, struct_as_record=False
    )
    result = {k: x for k, x in data.items() if hasattr(x, "gyr")}
    return [
        of_arrays(100.0, {k: (np.array(x.acc, float), np.array(x.gyr, float)) for k, x in result.items()})
    ]


def feet_of_gaitmap() -> list[UniformRecording]:
    result = []
    for name in gaitmap.COPIES:
        x = gaitmap.signals(name)
        sides = {"l": x[:, :6], "r": x[:, 6:]}
        result.append(
            of_arrays(gaitmap.RATE, {k: (s[:, :3], np.radians(s[:, 3:])) for k, s in sides.items()})
        )
    return result


def lower_backs() -> list[UniformRecording]:
    return [synchronise(mobgap.recording(trial)) for trial in mobgap.TRIALS]


def awinda_samples() -> list[UniformRecording]:
    """MT Manager exports of several makers' samples, each file separately."""
    result = []
    for folder, pattern in (
        (data_folder("mtw_csv_sample"), "*.csv"),
        (data_folder("opensense_xsens_apdm"), "xsens_formats/*.txt"),
    ):
        for path in sorted(folder.rglob(pattern)):
            if "sit_to_stand" in path.name:
                continue  # without acceleration
            recording = read_recording([SourceFile.of_path(path)])
            for device, s in recording.streams.items():
                if s.gyr is not None:
                    good = np.isfinite(s.acc).all(axis=1) & np.isfinite(s.gyr).all(axis=1)
                    result.append(of_arrays(s.rate_hz, {device: (s.acc[good], s.gyr[good])}))
    return result


def opals() -> list[UniformRecording]:
    (path,) = data_folder("opensense_xsens_apdm").rglob("imuData01.csv")
    rows = list(csv.reader(path.read_text().splitlines()))
    names, x = rows[2], np.array([r for r in rows[4:] if r and r[0]])
    places = sorted({n.split("/")[0] for n in names if n.endswith("/Angular Velocity/X")})

    def three(place: str, kind: str) -> Floats:
        return np.stack([x[:, names.index(f"{place}/{kind}/{c}")].astype(float) for c in "XYZ"], axis=1)

    return [of_arrays(128.0, {p: (three(p, "Acceleration"), three(p, "Angular Velocity")) for p in places})]


REAL = (lambda: [neura_walk()], feet_of_gaitmap, ipol, qmt, lower_backs, awinda_samples, opals)
NAMES = ("neura", "gaitmap", "ipol", "qmt", "mobgap", "awinda", "opal")


@pytest.mark.recorded
@pytest.mark.parametrize("takes", REAL, ids=NAMES)
def test_real_sensors_all_measure(takes: Callable[[], list[UniformRecording]]) -> None:
    result = takes()
    assert result
    for recording in result:
        assert mark_stuck(recording) is recording
        # what a coarse export leaves of them: a tenth of m/s², one degree per second
        rounded = coarse(recording, 0.1, np.radians(1.0))
        assert mark_stuck(rounded) is rounded


@pytest.mark.sweep
@pytest.mark.parametrize("script", sweep_after(1, [s for s in SCRIPTS if s != "five_minutes"]))
def test_simulated_sensors_all_measure(script: str) -> None:
    recording = synchronise(simulate_scenario(script, 0).recording)
    assert mark_stuck(recording) is recording


def test_a_heel_strike_beyond_the_range_leaves_the_foot_in() -> None:
    recording = comfortable()

    def clip_peaks(acc: Floats, gyr: Floats, k: int) -> None:
        # 3 samples of every stride are at the end of a range of 4 g
        for first in range(700, len(acc) - 10, 110):
            acc[first : first + 3, 0] = 4.0 * GRAVITY

    assert told(mark_stuck(spoilt(recording, "foot_l", clip_peaks, 0.0)).notices) == []


def recording_of(uniform: UniformRecording) -> Recording:
    streams: dict[Segment, ImuStream] = {s: stream(s, x.acc, x.gyr) for s, x in uniform.sensors.items()}
    return replace(take(streams), subject=uniform.subject)


@cache
def sound() -> TakeAnalysis:
    return analyse(recording_of(cut(comfortable(), 0.0, 30.0)))


@cache
def without(segment: Segment, spoil: Spoil) -> TakeAnalysis:
    return analyse(recording_of(spoilt(cut(comfortable(), 0.0, 30.0), segment, spoil, 0.0)))


@pytest.mark.slow
@pytest.mark.parametrize("spoil", [dead_gyroscope, stuck_accelerometer], ids=["gyroscope", "accelerometer"])
@pytest.mark.parametrize("segment", ["pelvis", "thigh_l"])
def test_a_dead_channel_leaves_no_plausible_number_of_its_sensor(segment: Segment, spoil: Spoil) -> None:
    """Other sensors are unaffected; parameters that need this sensor are suppressed."""
    result = without(segment, spoil)
    assert told(result.notices) == [("channel_stuck", segment)]
    assert result.quality.level == "poor"
    assert result.poses is not None
    assert result.poses.method != "erkf_smoothed"
    assert result.poses.reduced == "sensor_failed"
    assert result.orientations is not None
    assert segment not in result.orientations.q
    good = {(p.name, p.side): p for p in sound().parameters}
    times = 0
    for p in result.parameters:
        was = good.get((p.name, p.side))
        if p.name.endswith(("_s", "_pct")) and was is not None and p.mean is not None:
            assert was.mean is not None
            assert p.mean == pytest.approx(was.mean, rel=0.05, abs=1.0 if p.unit == "%" else 0.01), p.name
            times += 1
    assert times >= 20
    trunk = [p for p in result.parameters if p.name.startswith(("harmonic", "step_reg", "stride_reg"))]
    assert trunk
    if segment == "pelvis":
        assert all(p.mean is None and p.reason for p in trunk)


def test_a_take_without_a_sensor_that_measures_stops_with_a_sentence() -> None:
    recording = cut(comfortable(), 0.0, 30.0)
    for segment in recording.sensors:
        recording = spoilt(recording, segment, no_acceleration, 0.0)
    analysis = analyse(recording_of(recording))
    assert analysis.problem is not None
    assert analysis.problem.code == "no_working_sensor"
    assert analysis.parameters == ()


@pytest.mark.sweep
def test_a_dead_gyroscope_is_left_out_of_a_live_take_before_it_starts() -> None:
    """Detected during the calibration walk, with the same message as for files; other sensors continue."""
    take = cut(comfortable(), 0.0, 26.0)
    broken = spoilt(take, "pelvis", dead_gyroscope, 0.0)
    online, frames = live(broken)
    (live_notice,) = (n for f in frames for n in f.notices if n.code in CODES)
    (file_notice,) = (n for n in mark_stuck(broken).notices if n.code in CODES)
    assert live_notice == file_notice
    assert frames[-1].stage == "running"
    assert online.chain is not None
    assert "pelvis" not in online.chain.segments
    assert not any("pelvis" in f.q for f in frames if f.method == "erkf")
    (row,) = (r for r in frames[-1].health if r.segment == "pelvis")
    assert row.stuck


@pytest.mark.sweep
def test_a_thigh_that_stops_measuring_live_has_no_angles_from_then_on() -> None:
    _, frames = live(spoilt(cut(comfortable(), 0.0, 30.0), "thigh_l", stuck_accelerometer, 22.0))
    assert [n.code for f in frames for n in f.notices if n.code in CODES] == ["channel_stuck"]
    assert frames[-1].stage == "running"
    known_at = next(f.t_s for f in frames if any(n.code in CODES for n in f.notices))
    assert 22.9 <= known_at <= 24.5
    final = [f for f in frames if f.t_s > known_at]
    assert all(np.isnan(f.angles["knee_flexion_l"]) and np.isnan(f.angles["hip_flexion_l"]) for f in final)
    assert np.isfinite(final[-1].angles["knee_flexion_r"])
    late = [s for f in frames for s in f.strides if s.side == "left" and s.start_s > known_at]
    assert late
    assert all(s.values["knee_flexion_rom_deg"] is None for s in late)


@pytest.mark.parametrize(("start_s", "length"), [(20.0, 4), (20.0, 30), (20.3, 30), (20.6, 45), (20.9, 40)])
def test_a_hiccup_in_which_a_foot_swings_is_lost(start_s: float, length: int) -> None:
    """Whether the repeated sample is from swing or stance."""

    def pause(acc: Floats, gyr: Floats, k: int) -> None:
        acc[k + 1 : k + length], gyr[k + 1 : k + length] = acc[k], gyr[k]

    first = round(100 * start_s)
    rate = np.linalg.norm(comfortable().sensors["foot_r"].gyr, axis=1)
    assert rate[first : first + length].max() > 1.0
    stuck = mark_stuck(spoilt(comfortable(), "foot_r", pause, start_s))
    assert told(stuck.notices) == [("sensor_frozen", "foot_r")]
    lost = np.flatnonzero(~stuck.sensors["foot_r"].valid)
    assert first <= lost[0] <= first + 1
    assert lost[-1] in (first + length - 1, first + length)
    assert len(lost) == lost[-1] - lost[0] + 1
