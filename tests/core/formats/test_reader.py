"""The one door: what belongs to an upload, what is ignored, what is asked for."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sagittal.core.errors import ArchiveError, FormatError, ManifestError
from sagittal.core.formats import SourceFile, manifest_of, read_recording, write_recording
from sagittal.core.formats.reader import is_too_long
from tests.core.formats.making import mt_file, source, zipped

MAPPING = """<?xml version="1.0"?><OpenSimDocument><XsensDataReaderSettings><ExperimentalSensors>
<ExperimentalSensor name="_00B40B91"><name_in_model>pelvis_imu</name_in_model></ExperimentalSensor>
<ExperimentalSensor name="_00B40C44"><name_in_model>hand_r_imu</name_in_model></ExperimentalSensor>
</ExperimentalSensors></XsensDataReaderSettings></OpenSimDocument>"""


def test_a_manifest_among_the_files_is_used() -> None:
    text = '{"subject": {"height_m": 1.75}, "sensors": {"00b40b91": "pelvis", "00B40C44": null}}'
    recording = read_recording([mt_file(), mt_file("00B40C44", seed=1), source("in/manifest.json", text)])
    assert dict(recording.segments) == {"00B40B91": "pelvis", "00B40C44": None}
    assert recording.subject.height_m == 1.75
    assert recording.unassigned == ()
    assert len(recording.sha256) == 3


def test_a_given_manifest_is_completed_by_the_one_among_the_files() -> None:
    inside = {
        "subject": {"height_m": 1.8, "standing_width_m": 0.2},
        "protocol": "treadmill",
        "belt_speed_mps": 1.2,
        "mounting": {"pelvis": "sacrum", "foot_l": "instep"},
        "sensors": {"00B40B91": "foot_l"},
        "sources": [{"file": "*.txt", "rate_hz": 50}],
    }
    given = manifest_of(
        {
            "subject": {"height_m": 1.7},
            "mounting": {"pelvis": "belt"},
            "sensors": {"00B40B91": "pelvis"},
        }
    )
    files = [mt_file(), source("manifest.json", json.dumps(inside))]
    recording = read_recording(files, given)
    assert recording.segments == {"00B40B91": "pelvis"}
    assert recording.streams["00B40B91"].rate_hz == 50.0
    assert (recording.subject.height_m, recording.subject.standing_width_m) == (1.7, 0.2)
    assert recording.mounting == {"pelvis": "belt", "foot_l": "instep"}
    assert (recording.protocol, recording.belt_speed_mps) == ("treadmill", 1.2)
    walk = read_recording(files, manifest_of({"protocol": "walk"}))
    assert (walk.protocol, walk.belt_speed_mps) == ("walk", None)
    assert walk.segments == {"00B40B91": "foot_l"}


def test_two_manifests_or_a_broken_one_are_refused() -> None:
    one = source("manifest.json", '{"sensors": {}}')
    with pytest.raises(ManifestError) as e:
        read_recording([mt_file(), one, source("b/manifest.json", '{"sensors": {}}')])
    assert e.value.code == "manifest_twice"
    with pytest.raises(ManifestError) as e:
        read_recording([mt_file(), source("manifest.json", "{")])
    assert e.value.code == "manifest_bad_json"
    twice = '{"sensors": {"00B40B91": "pelvis", "00B40B91": "foot_l"}}'
    with pytest.raises(ManifestError, match="the key '00B40B91' is given twice") as e:
        read_recording([mt_file(), source("who-wears-what.json", twice)])
    assert e.value.code == "manifest_bad_json"


def test_an_opensense_mapping_maps_and_unknown_bodies_are_set_aside() -> None:
    recording = read_recording([mt_file(), mt_file("00B40C44", seed=1), source("map.xml", MAPPING)])
    assert dict(recording.segments) == {"00B40B91": "pelvis", "00B40C44": None}


def test_an_xml_bomb_is_not_expanded() -> None:
    bomb = '<?xml version="1.0"?><!DOCTYPE z [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]>' + MAPPING[21:]
    recording = read_recording([mt_file(), source("map.xml", bomb.replace("pelvis_imu", "&b;"))])
    assert [n.code for n in recording.notices] == ["file_not_read"]
    assert dict(recording.segments) == {}


def test_an_encoding_that_nobody_knows_is_refused() -> None:
    named = '<?xml version="1.0" encoding="no-such-code"?>' + MAPPING.partition("?>")[2]
    recording = read_recording([mt_file(), source("map.xml", named)])
    assert [n.code for n in recording.notices] == ["file_not_read"]


def test_readme_and_system_files_are_ignored_and_said() -> None:
    junk = [
        source("readme.txt", "my walk"),
        source(".DS_Store", b"\0\0\0\1Bud1\0"),
        source("p.png", b"\x89PNG\0"),
    ]
    recording = read_recording([mt_file(), *junk])
    assert list(recording.streams) == ["00B40B91"]
    assert {(n.code, n.severity) for n in recording.notices} == {("ignored_file", "info")}
    assert len(recording.notices) == 3


def test_a_sensor_file_that_cannot_be_read_does_not_stop_the_others() -> None:
    recording = read_recording([mt_file(), source("take_00B40C44.txt", "")])
    assert [(n.code, n.severity) for n in recording.notices] == [("file_not_read", "warning")]
    assert "take_00B40C44.txt is empty" in recording.notices[0].message


def test_a_declared_sensor_without_a_file_is_said() -> None:
    recording = read_recording(
        [mt_file()], manifest_of({"sensors": {"00B40B91": "pelvis", "00B40C55": "foot_l"}})
    )
    assert [n.code for n in recording.notices] == ["sensor_missing"]
    assert "foot_l" in recording.notices[0].message


def test_nothing_readable_names_what_was_tried() -> None:
    with pytest.raises(FormatError) as e:
        read_recording([source("a.txt", "hello"), source("b.bin", b"\0\1\2")])
    assert e.value.code == "unknown_format"
    assert "MT Manager" in e.value.message
    assert "a.txt" in e.value.message


def test_one_fault_of_all_sensor_files_is_told_once() -> None:
    empty = [source(f"take_00B40C4{i}.txt", "") for i in range(3)]
    with pytest.raises(FormatError) as e:
        read_recording([*empty, source("README.md", "About this take.")])
    assert e.value.code == "empty"
    assert e.value.message == (
        "take_00B40C40.txt is empty; copy or export it again. The same holds of 2 other files."
    )


def test_faults_that_differ_are_each_told_once() -> None:
    files = [
        source("a.txt", ""),
        source("b.txt", ""),
        SourceFile.of_bytes("c.mat", b"MATLAB 5.0 MAT-file, Platform: PCWIN64"),
    ]
    with pytest.raises(FormatError) as e:
        read_recording(files)
    assert e.value.message.count("is empty") == 1
    assert "a.txt is empty; copy or export it again. The same holds of 1 other file." in e.value.message
    assert "c.mat is " in e.value.message


def test_no_files_and_an_empty_zip_are_refused() -> None:
    for files in ([], [SourceFile.of_bytes("a.zip", zipped({}))]):
        with pytest.raises(FormatError) as e:
            read_recording(files)
        assert e.value.code == "empty"


def test_a_bad_archive_stops_the_upload() -> None:
    with pytest.raises(ArchiveError):
        read_recording([mt_file(), SourceFile.of_bytes("a.zip", zipped({"../x.txt": b""}))])


def test_names_with_emoji_just_work() -> None:
    file = SourceFile.of_bytes("Gehen 🚶‍♀️/Übung_00B40B91.txt", mt_file().read())
    recording = read_recording([file])
    assert recording.streams["00B40B91"].source == "Gehen 🚶‍♀️/Übung_00B40B91.txt"
    again = read_recording([SourceFile.of_bytes("🦶.parquet", write_recording(recording))])
    assert again.streams["00B40B91"].source == "Gehen 🚶‍♀️/Übung_00B40B91.txt"


def test_the_order_of_the_files_does_not_change_the_signals() -> None:
    files = [mt_file("00B40B91"), mt_file("00B40C44", seed=1, start=40)]
    a, b = read_recording(files), read_recording(files[::-1])
    for device in a.streams:
        np.testing.assert_array_equal(a.streams[device].t_s, b.streams[device].t_s)
        assert a.streams[device].digest == b.streams[device].digest


def test_a_take_is_too_long_by_what_its_analysis_needs() -> None:
    hour = 3600.0 * 100.0
    assert not is_too_long(14.0 * hour, 2)
    assert is_too_long(15.0 * hour, 2)
    assert not is_too_long(5.5 * hour, 7)
    assert is_too_long(7.0 * hour, 7)
    assert not is_too_long(5.5 * hour, 1)
    assert is_too_long(8.0 * hour, 1)


def test_a_table_without_a_description_is_a_recording_only_if_nothing_else_is() -> None:
    rows = [
        f"{k / 100:.2f},{0.1 * np.sin(k / 9):.4f},0.2,9.8,{np.cos(k / 9):.4f},1.0,{k % 7}" for k in range(800)
    ]
    table = "\n".join(["time_s,acc_x,acc_y,acc_z,gyr_x,gyr_y,gyr_z", *rows])
    alone = read_recording([source("foot_l.csv", table)])
    assert len(alone.streams) == 1
    assert "table_guessed" in {n.code for n in alone.notices}
    beside = read_recording([mt_file(), source("foot_l.csv", table)])
    assert set(beside.streams) == {"00B40B91"}
    assert "table_guessed" not in {n.code for n in beside.notices}
    assert "foot_l.csv" not in beside.sha256
