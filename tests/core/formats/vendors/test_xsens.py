"""Variants and damage of MT Manager text."""

from __future__ import annotations

import gzip

import numpy as np
import pytest

from sagittal.core.errors import FormatError
from sagittal.core.formats import SourceFile, parse_manifest, read_recording
from sagittal.core.signals.recording import ImuStream
from tests.core.formats.making import HEAD, mt_file, mt_text, signals, source

ACC, GYR = signals(300, still=100)


def one(text: str | bytes, name: str = "take_00B40B91.txt", manifest: str | None = None) -> ImuStream:
    recording = read_recording([source(name, text)], parse_manifest(manifest.encode()) if manifest else None)
    (stream,) = recording.streams.values()
    return stream


def codes(stream: ImuStream) -> list[str]:
    return [n.code for n in stream.notices]


@pytest.mark.parametrize("separator", ["\t", ",", ";", " "])
@pytest.mark.parametrize("blank", ["", "NaN"])
@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_every_separator_blank_and_line_end_gives_the_same_numbers(
    separator: str, blank: str, ending: str
) -> None:
    stream = one(mt_text(ACC, GYR, separator=separator, blank=blank).replace("\n", ending))
    np.testing.assert_allclose(stream.acc, ACC, atol=1e-6)
    assert stream.gyr is not None
    np.testing.assert_allclose(stream.gyr, GYR, atol=1e-6)
    assert stream.device_id == "00B40B91"
    assert codes(stream) == []


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_byte_order_marks_do_not_matter(encoding: str) -> None:
    np.testing.assert_allclose(one(mt_text(ACC, GYR).encode(encoding)).acc, ACC, atol=1e-6)


def test_a_decimal_comma_is_understood() -> None:
    text = mt_text(ACC, GYR, separator=";")
    top, rows = text.split("\nPacket")
    np.testing.assert_allclose(one(top + "\nPacket" + rows.replace(".", ",")).acc, ACC, atol=1e-6)


def test_gzip_is_unpacked() -> None:
    stream = one(gzip.compress(mt_text(ACC, GYR).encode()), "take_00B40B91.txt.gz")
    assert stream.source == "take_00B40B91.txt"
    assert len(stream.t_s) == 300


def test_the_content_decides_not_the_name() -> None:
    assert one(mt_text(ACC, GYR), "holiday 🏖️ photo.png").device_id == "holiday 🏖️ photo"


def test_a_counter_that_wraps_at_16_bit_keeps_running() -> None:
    stream = one(mt_text(ACC, GYR, counter=range(65400, 65700)))
    np.testing.assert_allclose(np.diff(stream.t_s), 0.01, atol=1e-9)


def test_sensors_that_start_on_both_sides_of_the_wrap_stay_together() -> None:
    files = [mt_file("00B40B91", start=65530), mt_file("00B40C44", seed=1, start=65536 + 4)]
    a, b = read_recording(files).streams.values()
    assert (a.t_s[0], round(b.t_s[0], 9)) == (0.0, 0.1)


def test_lost_packets_leave_a_hole_in_time() -> None:
    counter = [*range(100), *range(150, 350)]
    assert one(mt_text(ACC, GYR, counter=counter)).t_s[100] == pytest.approx(1.5)


def test_a_repeated_packet_is_left_out_and_said() -> None:
    counter = [*range(150), 149, *range(150, 299)]
    stream = one(mt_text(ACC, GYR, counter=counter))
    assert len(stream.t_s) == 299
    assert codes(stream) == ["rows_repeated"]
    assert stream.notices[0].severity == "info", "one row in 300 changes no number"


def test_two_takes_in_one_file_are_refused() -> None:
    with pytest.raises(FormatError, match="two recordings") as e:
        one(mt_text(ACC, GYR, counter=[*range(1000, 1150), *range(1000, 1150)]))
    assert e.value.code == "counter_restart"


def test_a_missing_gyroscope_is_a_notice() -> None:
    stream = one(mt_text(ACC))
    assert stream.gyr is None
    assert codes(stream) == ["missing_gyro"]


def test_blank_gyroscope_columns_are_a_missing_gyroscope() -> None:
    assert codes(one(mt_text(ACC, np.full_like(GYR, np.nan)))) == ["missing_gyro"]


def test_missing_values_stay_missing() -> None:
    acc = ACC.copy()
    acc[10, 1] = np.nan
    stream = one(mt_text(acc, GYR))
    assert np.isnan(stream.acc[10, 1])
    assert np.isnan(stream.acc).sum() == 1


def test_no_update_rate_is_an_error_notice_until_somebody_names_it() -> None:
    text = mt_text(
        ACC, GYR, head="// General information: \n//  DeviceId: 00B42D4B\n// Coordinate system: ENU\n"
    )
    stream = one(text)
    assert stream.device_id == "00B42D4B"
    assert [(n.code, n.severity) for n in stream.notices] == [("rate_unknown", "error")]
    named = one(text, manifest='{"sources": [{"file": "*.txt", "rate_hz": 60}]}')
    assert named.rate_hz == 60.0
    assert codes(named) == []


def test_the_rate_comes_from_the_sample_time_when_it_is_there() -> None:
    rows = [f"{i}\t{1000 + 125 * i}\t0.1\t0.2\t9.8\t0.0\t0.1\t0.0" for i in range(50)]
    header = "PacketCounter\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z"
    stream = one("// Coordinate system: ENU\n" + header + "\n" + "\n".join(rows) + "\n")
    assert stream.rate_hz == pytest.approx(80.0)


def test_the_rate_comes_from_the_other_sensors_of_the_take() -> None:
    silent = source("take_00B40C44.txt", mt_text(*signals(300, 1), head="// Coordinate system: ENU\n"))
    streams = read_recording([mt_file(), silent]).streams
    assert streams["00B40C44"].rate_hz == 100.0
    assert [n.severity for n in streams["00B40C44"].notices] == ["info"]


def test_units_that_the_exporter_changed_are_put_right_by_the_manifest() -> None:
    text = mt_text(ACC / 9.80665, np.degrees(GYR))
    stream = one(text, manifest='{"sources": [{"file": "*", "acc_unit": "g", "gyr_unit": "deg/s"}]}')
    assert stream.gyr is not None
    np.testing.assert_allclose(stream.acc, ACC, atol=1e-5)
    np.testing.assert_allclose(stream.gyr, GYR, atol=1e-6)


def test_a_cut_off_last_line_is_left_out_and_said() -> None:
    whole = mt_text(ACC, GYR)
    for cut in (3, 10, 40):
        stream = one(whole[:-cut])
        assert len(stream.t_s) == 299, cut
        assert codes(stream) == ["truncated_line"], cut
        assert stream.notices[0].severity == "info"
    assert codes(one(whole[:-1])) == []


def test_damaged_cells_count_as_missing_and_are_said() -> None:
    lines = mt_text(ACC, GYR).split("\n")
    cells = lines[50].split("\t")
    lines[50] = "\t".join([*cells[:4], "#####", *cells[5:]])
    stream = one("\n".join(lines))
    assert codes(stream) == ["bad_cells"]
    assert stream.notices[0].severity == "info"
    assert len(stream.t_s) == 300
    assert np.isnan(stream.acc).sum() == 1


def test_collapsed_blanks_are_right_aligned_or_refused() -> None:
    collapsed = mt_text(ACC, GYR, separator=" ").replace("  ", " ")
    np.testing.assert_allclose(one(collapsed).acc, ACC, atol=1e-6)
    lines = collapsed.split("\n")
    shorter = [line.rsplit(" ", 1)[0] if line[:1].isdigit() else line for line in lines]
    with pytest.raises(FormatError) as e:
        one("\n".join(shorter))
    assert e.value.code == "collapsed_columns"


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("", "empty"),
        ("\n \n", "empty"),
        (HEAD.format(rate=100.0), "unknown_format"),
        (mt_text(ACC[:0], GYR[:0]), "empty"),
        (mt_text(np.full_like(ACC, np.nan), GYR), "missing_acc"),
        (mt_text(ACC, GYR).replace("Acc_", "FreeAcc_"), "gravity_removed"),
        (mt_text(ACC, GYR, counter=[0] * 300), "time_constant"),
        ("once upon a time\nthere was a foot\n", "unknown_format"),
    ],
)
def test_useless_files_are_refused_with_a_code(text: str, code: str) -> None:
    with pytest.raises(FormatError) as e:
        one(text)
    assert e.value.code == code
    assert len(e.value.message) > 20


@pytest.mark.slow
def test_any_cut_of_a_file_is_read_or_refused_but_never_crashes() -> None:
    data = mt_text(ACC[:40], GYR[:40]).encode()
    for cut in range(0, len(data), 7):
        try:
            stream = one(data[:cut])
        except FormatError as refusal:
            assert refusal.code in {"empty", "unknown_format", "missing_acc", "bad_table"}  # noqa: PT017
        else:
            np.testing.assert_allclose(stream.acc, ACC[: len(stream.acc)], atol=1e-6)


def test_the_same_file_twice_is_one_sensor_and_two_takes_of_it_are_refused() -> None:
    recording = read_recording([mt_file(), SourceFile.of_bytes("copy/take_00B40B91.txt", mt_file().read())])
    assert len(recording.streams) == 1
    assert codes(recording.streams["00B40B91"]) == ["file_given_twice"]
    with pytest.raises(FormatError) as e:
        read_recording([mt_file(), SourceFile.of_bytes("b/take_00B40B91.txt", mt_file(seed=3).read())])
    assert e.value.code == "duplicate_device"
    assert "b/take_00B40B91.txt" in e.value.message


def test_sensors_at_different_update_rates_are_an_error_notice() -> None:
    other = source("take_00B40C44.txt", mt_text(*signals(300, 1), rate=60.0))
    third = mt_file("00B40C55", seed=2)
    streams = read_recording([mt_file(), other, third]).streams
    assert [(n.code, n.severity) for n in streams["00B40C44"].notices] == [("rates_differ", "error")]
