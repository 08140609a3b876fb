"""Every real vendor file we have either gives the recording it holds or a sentence that says why not."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sagittal.core import rotation
from sagittal.core.errors import FormatError, InputError
from sagittal.core.formats import SourceFile, parse_manifest, read_recording, write_recording
from sagittal.core.signals.recording import Recording
from tests.data import data_folder
from tests.helpers.ipol import ipol_recording

MT = "opensense_xsens_apdm/xsens_formats/"
WALK = "opensense_xsens_apdm/walk_8imu_noGyr/MT_012005D6_009-001_"
# file, device, samples, signals besides acc, notices
READABLE = [
    (MT + "MT2022_ACC_00B42D4B.txt", "00B42D4B", 5, "", {"missing_gyro", "rate_unknown"}),
    (MT + "MT2022_ACC_GYRO_ROT_ALL_TAB_NAN_00B42D4B.txt", "00B42D4B", 5, "gq", {"rate_unknown"}),
    (MT + "MT2022_ACC_GYRO_ROT_EULER_TAB_00B42D4F.txt", "00B42D4F", 5, "gq", {"rate_unknown"}),
    (MT + "MT2022_ACC_GYRO_ROT_MAT_COMMA_00B42D4B.txt", "00B42D4B", 5, "gq", {"rate_unknown"}),
    (MT + "MT2022_ACC_GYRO_ROT_MAT_SEMICOLON_00B42D4B.txt", "00B42D4B", 5, "gq", {"rate_unknown"}),
    (MT + "MT2022_ACC_GYRO_ROT_MAT_SPACE_00B42D4B.txt", "00B42D4B", 5, "gq", {"rate_unknown"}),
    (MT + "MT46_01-000_00B42D4D.txt", "00B42D4D", 5, "gq", set()),
    (MT + "MT46_01-000_00B42D4E.txt", "00B42D4E", 5, "gq", set()),
    (MT + "MT_01200312-002-000_00B474BA.txt", "00B474BA", 5, "q", {"missing_gyro", "rate_unknown"}),
    (MT + "MT_01200454_000-000_00B40DE4.txt", "00B40DE4", 4, "gmq", {"rate_unknown"}),
    (MT + "MT_012005D6_031-000_00B421AF.txt", "00B421AF", 3369, "gmq", set()),
    (MT + "MT_012005D6_031-000_00B4227B.txt", "00B4227B", 3369, "gmq", set()),
    (MT + "test1_00B421E6.txt", "00B421E6", 3, "gq", set()),
    ("formats/xsens_full/MT_012005D6_031-000_00B421AF.txt.gz", "00B421AF", 3369, "gmq", set()),
    ("formats/xsens_mt_manager/MT_012005D6_031-000_00B421AF_first200.txt", "00B421AF", 200, "gmq", set()),
    ("mtw_csv_sample/mtwawinda/example_calibration_xsens/example_calibration_xsens_00b45c23.csv", "00B45C23", 1253, "gmq", set()),  # noqa: E501
    ("neura_walk/rawimu/S02-Trial-Walk-1-000_00B40B91.txt", "00B40B91", 2503, "gmq", set()),
    (WALK + "00B421E6.txt", "00B421E6", 2432, "q", {"missing_gyro"}),
    ("formats/xsens_dot/SYNTHETIC_R_shank_20261120_101500_000.csv", "R_shank", 117, "gq", set()),
]  # fmt: skip
REFUSED = [
    (MT + "MT_012005D6-000_sit_to_stand-000_00B421ED.txt", "missing_acc"),
    ("formats/opensense/imuOrientations.sto", "unsupported_format"),
    (
        "xsens_dot_samples/Original_XsensDot_Data_Realtime/RTibia_20210820_202113_825.csv",
        "gravity_removed",
    ),
    ("mobgap_lowback/data/lab/HA/001/data.mat", "unsupported_format"),
    ("formats/mobilised/HA001_TimeMeasure1_Test5_Trial1.csv", "manifest_needed"),
    ("gaitmap_foot/imu_sample.csv", "manifest_needed"),
    ("formats/xsens_dot/SYNTHETIC_recording_export_euler.csv", "gravity_removed"),
    ("gaitmap_foot/LICENSE_upstream.txt", "unknown_format"),
]


def read(path: str) -> Recording:
    return read_recording([SourceFile.of_path(data_folder(*path.split("/")))])


@pytest.mark.recorded
@pytest.mark.parametrize(
    ("path", "device", "n", "more", "codes"), READABLE, ids=[r[0][-40:] for r in READABLE]
)
def test_a_vendor_file_gives_the_signals_it_holds(
    path: str, device: str, n: int, more: str, codes: set[str]
) -> None:
    recording = read(path)
    assert list(recording.streams) == [device]
    stream = recording.streams[device]
    assert len(stream.t_s) == n
    assert (stream.gyr is not None, stream.mag is not None, stream.quat is not None) == tuple(
        c in more for c in "gmq"
    )
    assert {x.code for x in stream.notices} == codes
    assert 9.5 < np.nanmedian(np.linalg.norm(stream.acc, axis=1)) < 10.5


@pytest.mark.recorded
@pytest.mark.parametrize(
    ("path", "device", "n", "more", "codes"), READABLE, ids=[r[0][-40:] for r in READABLE]
)
def test_our_own_file_gives_back_what_was_read(
    path: str, device: str, n: int, more: str, codes: set[str]
) -> None:
    first = read(path).streams[device]
    again = read_recording([SourceFile.of_bytes("x", write_recording(read(path)))]).streams[device]
    assert again.digest == first.digest
    assert again.notices == first.notices
    assert again.rate_hz == first.rate_hz
    np.testing.assert_array_equal(again.acc.astype(np.float32), first.acc.astype(np.float32))
    np.testing.assert_allclose(again.t_s, first.t_s, atol=5e-7)


# file, rate, samples, sensors with their segment
SEVERAL = [
    (
        "formats/apdm/apdm_format7.csv",
        128.0,
        3,
        {
            "5718": "pelvis",
            "5778": "shank_r",
            "5811": "shank_l",
            "6570": "foot_l",
            "6575": "chest",
            "6833": "foot_r",
        },
    ),
    (
        "formats/apdm/imuData01_full.csv.gz",
        128.0,
        1024,
        dict.fromkeys(("Static", "Upper", "Middle", "Lower")),
    ),
    ("formats/apdm/SYNTHETIC_v5.h5", 128.0, 256, {"1234": "pelvis", "1235": "foot_r", "1236": "foot_l"}),
    (
        "formats/mvnx/SYNTHETIC_lowerbody.mvnx",
        60.0,
        10,
        {
            "Pelvis": "pelvis",
            "RightUpperLeg": "thigh_r",
            "RightLowerLeg": "shank_r",
            "RightFoot": "foot_r",
            "LeftUpperLeg": "thigh_l",
            "LeftLowerLeg": "shank_l",
            "LeftFoot": "foot_l",
        },
    ),
    ("formats/phone/SYNTHETIC_devicemotion.json", 59.88, 5, {"SYNTHETIC_devicemotion": None}),
]


@pytest.mark.recorded
@pytest.mark.parametrize(("path", "rate", "n", "worn"), SEVERAL, ids=[r[0][-40:] for r in SEVERAL])
def test_a_file_of_several_sensors_gives_them_with_rate_and_place(
    path: str, rate: float, n: int, worn: dict[str, str | None]
) -> None:
    if path.endswith(".h5"):
        pytest.importorskip("h5py")
    recording = read(path)
    assert {d: recording.segments.get(d) for d in recording.streams} == worn
    for stream in recording.streams.values():
        assert len(stream.t_s) == n
        assert stream.rate_hz == pytest.approx(rate, rel=1e-4)
        assert stream.gyr is not None
        assert 8.5 < np.nanmedian(np.linalg.norm(stream.acc, axis=1)) < 10.5


@pytest.mark.recorded
@pytest.mark.parametrize(("path", "code"), REFUSED, ids=[r[0][-40:] for r in REFUSED])
def test_what_cannot_be_read_is_refused_with_its_name(path: str, code: str) -> None:
    with pytest.raises(FormatError) as e:
        read(path)
    assert e.value.code == code
    assert path.rsplit("/", 1)[-1] in e.value.message


@pytest.mark.recorded
def test_no_sample_file_crashes_the_reader() -> None:
    """Alone and without a manifest every file is either read or refused by one of our errors."""
    files = [p for p in data_folder().rglob("*") if p.is_file() and p.stat().st_size < 1_500_000]
    assert len(files) > 50
    read_ones = 0
    refusals: dict[str, InputError] = {}
    for path in files:
        try:
            read_recording([SourceFile.of_path(path)])
            read_ones += 1
        except InputError as refusal:
            refusals[path.name] = refusal
    assert all(r.code and len(r.message) > 20 for r in refusals.values())
    assert read_ones >= 30


@pytest.mark.recorded
def test_separators_and_orientation_forms_of_one_recording_agree() -> None:
    """The 2022 export exists with four separators and as quaternion + Euler + matrix: same numbers in all."""
    everything = read(MT + "MT2022_ACC_GYRO_ROT_ALL_TAB_NAN_00B42D4B.txt").streams["00B42D4B"]
    assert everything.gyr is not None
    assert everything.quat is not None
    for name in ("COMMA", "SEMICOLON", "SPACE"):
        other = read(MT + f"MT2022_ACC_GYRO_ROT_MAT_{name}_00B42D4B.txt").streams["00B42D4B"]
        assert other.quat is not None
        np.testing.assert_array_equal(other.gyr, everything.gyr)
        assert np.max(rotation.angle_between(other.quat, everything.quat)) < 1e-5
        np.testing.assert_allclose(rotation.rotate(other.quat, other.acc)[:, :2], 0.0, atol=0.2)


@pytest.mark.recorded
def test_vendor_euler_angles_turn_gravity_up() -> None:
    stream = read(MT + "MT2022_ACC_GYRO_ROT_EULER_TAB_00B42D4F.txt").streams["00B42D4F"]
    assert stream.quat is not None
    up = rotation.rotate(stream.quat, stream.acc).mean(axis=0)
    assert np.hypot(up[0], up[1]) < 0.15
    assert up[2] > 9.7


@pytest.mark.recorded
def test_an_opensense_folder_brings_its_own_mapping() -> None:
    folder = data_folder("opensense_xsens_apdm", "walk_8imu_noGyr")
    recording = read_recording([SourceFile.of_path(p) for p in sorted(folder.iterdir())])
    assert recording.segments["00B42279"] == "pelvis"
    assert sorted(s for s in recording.segments.values() if s) == [
        "chest", "foot_l", "foot_r", "pelvis", "shank_l", "shank_r", "thigh_l", "thigh_r",
    ]  # fmt: skip
    assert {len(s.t_s) for s in recording.streams.values()} >= {2432, 2505}
    assert {float(s.t_s[0]) for s in recording.streams.values()} == {0.0}


@pytest.mark.recorded
def test_the_neura_upload_shows_eleven_files_nine_sensors() -> None:
    folder = data_folder("neura_walk", "rawimu")
    recording = read_recording([SourceFile.of_path(p) for p in sorted(folder.iterdir())])
    assert len(recording.streams) == 11
    assert len({s.digest for s in recording.streams.values()}) == 9
    assert len(recording.sha256) == 11


def gaitmap(name: str) -> Recording:
    columns = {
        f"foot_{side[0]}": {
            "acc": [f"{side}_sensor/acc_{a}" for a in "xyz"],
            "gyr": [f"{side}_sensor/gyr_{a}" for a in "xyz"],
            "mag": None,
        }
        for side in ("left", "right")
    }
    spec = {
        "file": name, "header_rows": 2, "index_column": True, "rate_hz": 204.8, "acc_unit": "m/s2",
        "gyr_unit": "deg/s", "gravity_included": True, "columns": columns, "quat_order": None, "frame": None,
    }  # fmt: skip
    manifest = parse_manifest(json.dumps({"sources": [spec]}).encode())
    return read_recording([SourceFile.of_path(data_folder("gaitmap_foot", name))], manifest)


def test_the_manifest_of_the_issue_reads_gaitmap() -> None:
    recording = gaitmap("imu_sample.csv")
    assert dict(recording.segments) == {"foot_l": "foot_l", "foot_r": "foot_r"}
    left = recording.streams["foot_l"]
    assert left.gyr is not None
    assert len(left.t_s) == 7928
    np.testing.assert_allclose(left.t_s[-1], 7927 / 204.8)
    np.testing.assert_allclose(left.acc[0], [0.8808107066241624, 2.7622080650315652, 9.408650477990726])
    np.testing.assert_allclose(np.degrees(left.gyr[0, 0]), -0.11240170597252427)


@pytest.mark.recorded
def test_both_gaitmap_copies_hold_the_same_norms() -> None:
    a, b = gaitmap("imu_sample.csv"), gaitmap("imu_sample_not_rotated.csv")
    for foot in ("foot_l", "foot_r"):
        np.testing.assert_allclose(
            np.linalg.norm(a.streams[foot].acc, axis=1),
            np.linalg.norm(b.streams[foot].acc, axis=1),
            atol=1e-6,
        )


@pytest.mark.recorded
@pytest.mark.parametrize("trial", ["11-1", "12-3", "13-2", "14-1"])
def test_tables_with_lost_packets_keep_their_time(trial: str) -> None:
    folder = data_folder("ipol_walks")
    recording = ipol_recording(trial)
    assert dict(recording.segments) == {"pelvis": "pelvis", "foot_l": "foot_l", "foot_r": "foot_r"}
    counters = {}
    for file, place in (("lf", "foot_l"), ("rf", "foot_r"), ("lb", "pelvis")):
        rows = (folder / f"{trial}_{file}.txt").read_text().splitlines()[2:]
        counters[place] = np.unique([float(row.split("\t")[0]) for row in rows])
    first = min(counts[0] for counts in counters.values())
    for place, counts in counters.items():
        stream = recording.streams[place]
        assert (stream.clock, stream.rate_hz) == ("counter", 100.0)
        np.testing.assert_allclose(stream.t_s, (counts - first) / 100, atol=1e-9)
    assert recording.streams["foot_l"].t_s[-1] == pytest.approx((counters["foot_l"][-1] - first) / 100)
