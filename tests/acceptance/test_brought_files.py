"""Files as people bring them, made of signals whose truth is known: read right without a manifest."""

from __future__ import annotations

import io
from collections.abc import Sequence
from functools import cache

import numpy as np
import openpyxl
import pytest

from sagittal.core.errors import FormatError
from sagittal.core.formats import SourceFile, read_recording
from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.signals.recording import Recording
from tests.core.formats.making import signals

N = 1500
T = np.arange(float(N)) / 100.0
FEET = ("foot_l", "foot_r")


@cache
def foot(seed: int) -> tuple[Floats, Floats]:
    acc, gyr = signals(N, seed, still=300)
    return acc, gyr


def names(time: str) -> list[str]:
    return [time, *(f"{f}_{kind}_{a}" for f in FEET for kind in ("acc", "gyr") for a in "xyz")]


def rows(times: Sequence[str]) -> list[list[str]]:
    values = np.hstack([s for i in range(2) for s in foot(i)])
    return [[t, *(f"{v:.5f}" for v in row)] for t, row in zip(times, values, strict=True)]


def table(time: str, times: Sequence[str], separator: str = ",") -> str:
    return "\n".join(separator.join(r) for r in [names(time), *rows(times)]) + "\n"


def check(recording: Recording, allowed_s: float = 1e-6, n: int = N) -> None:
    """Both feet are there with every sample at its time."""
    assert {recording.segments[d] for d in recording.streams} == set(FEET)
    for device, stream in recording.streams.items():
        acc, gyr = foot(FEET.index(str(recording.segments[device])))
        assert len(stream.t_s) == n
        np.testing.assert_allclose(stream.t_s, T[:n], atol=allowed_s)
        np.testing.assert_allclose(stream.acc, acc[:n], atol=2e-5)
        assert stream.gyr is not None
        np.testing.assert_allclose(stream.gyr, gyr[:n], atol=2e-5)


def read(text: str | bytes, name: str = "walk.csv") -> Recording:
    return read_recording([SourceFile.of_bytes(name, text if isinstance(text, bytes) else text.encode())])


SECONDS = [f"{t:.3f}" for t in T]


@pytest.mark.parametrize(
    ("time", "times"),
    [
        ("time_s", SECONDS),
        ("time_ms", [f"{1000 * t:.0f}" for t in T]),
        ("timestamp_us", [f"{1.7e15 + 1e6 * t:.0f}" for t in T]),
        ("tod_s", [f"{(86393.0 + t) % 86400:.3f}" for t in T]),
        ("local_s", [f"{7174.0 + t + 3600 * (t >= 7.0):.3f}" for t in T]),
        ("date", [f"2024-02-07 23:59:{55 + int(t):02d}.{round(100 * t) % 100:02d}0" for t in T[:500]]
         + [f"2024-02-08 00:00:{int(t - 5):02d}.{round(100 * t) % 100:02d}0" for t in T[500:]]),
    ],
)  # fmt: skip
def test_clocks_of_any_kind_are_read_without_a_manifest(time: str, times: list[str]) -> None:
    check(read(table(time, times)), 2e-5)


def test_decimal_commas_utf16_and_workbooks() -> None:
    european = table("time_s", SECONDS, ";").replace(".", ",")
    check(read(european))
    check(read("\ufeff" + table("time_s", SECONDS, "\t").replace(".", ",").replace(";", "\t"), "walk.txt"))
    check(read(table("time_s", SECONDS, "\t").replace(".", ",").encode("utf-16"), "walk.txt"))
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    for row in [names("time_s"), *([float(v) for v in r] for r in rows(SECONDS))]:
        sheet.append(row)
    out = io.BytesIO()
    book.save(out)
    check(read(out.getvalue(), "walk.xlsx"))


def test_whole_seconds_are_spread_evenly() -> None:
    recording = read(table("unix_s", [f"{1700000000 + int(t)}" for t in T]))
    check(recording, 0.01)
    assert {n.code for s in recording.streams.values() for n in s.notices} == {"stamps_shared"}


def test_a_header_in_the_middle_is_left_out() -> None:
    lines = table("time_s", SECONDS).splitlines()
    recording = read("\n".join([*lines[:700], "# resumed", lines[0], *lines[700:]]))
    check(recording)
    assert {n.code for s in recording.streams.values() for n in s.notices} == {"lines_without_values"}


def test_times_that_a_spreadsheet_made_equal_are_refused_with_the_cause() -> None:
    with pytest.raises(FormatError, match="spreadsheet") as e:
        read(table("timestamp_us", ["1.70000E+15"] * N))
    assert e.value.code == "time_constant"


def test_a_file_without_a_header_is_understood_by_its_values() -> None:
    files = []
    for i, side in enumerate(FEET):
        acc, gyr = foot(i)
        values = np.hstack([acc / GRAVITY, np.degrees(gyr)])
        lines = [
            f"2024-02-07 11:27:{27 + int(t):02d}.{round(100 * t) % 100:02d}0,"
            + ",".join(f"{v:.6f}" for v in row)
            for t, row in zip(T, values, strict=True)
        ]
        files.append(SourceFile.of_bytes(f"{side}.csv", "\n".join(lines).encode()))
    check(read_recording(files), 2e-5)


def test_a_sensor_in_two_files_with_packets_of_three() -> None:
    files = []
    for i, side in enumerate(FEET):
        for kind, unit, values in (
            ("Accelerometer", "g", foot(i)[0] / GRAVITY),
            ("Gyroscope", "deg/s", np.degrees(foot(i)[1])),
        ):
            stamps = 1700000000000 + 10 * 3 * (np.arange(N) // 3)
            lines = ["epoc (ms)," + ",".join(f"{a}-axis ({unit})" for a in "xyz")]
            lines += [
                f"{t}," + ",".join(f"{v:.6f}" for v in row) for t, row in zip(stamps, values, strict=True)
            ]
            files.append(SourceFile.of_bytes(f"{side}_{kind}.csv", "\n".join(lines).encode()))
    check(read_recording(files), 0.01)


def test_a_phone_whose_acceleration_is_without_gravity_needs_its_file_of_gravity() -> None:
    acc, gyr = foot(0)
    down = np.array([0.0, GRAVITY, 0.0])
    parts = {"Accelerometer": acc - down, "Gyroscope": gyr, "Gravity": np.tile(down, (N, 1))}
    files = []
    for kind, values in parts.items():
        lines = ["time,seconds_elapsed,z,y,x"]
        lines += [
            f"{1700000000000000000 + 10000000 * i},{t:.6f}," + ",".join(f"{v:.7f}" for v in row[::-1])
            for i, (t, row) in enumerate(zip(T, values, strict=True))
        ]
        files.append(SourceFile.of_bytes(f"foot_l/{kind}.csv", "\n".join(lines).encode()))
    (stream,) = read_recording(files).streams.values()
    np.testing.assert_allclose(stream.acc, acc, atol=1e-5)
    with pytest.raises(FormatError, match="TotalAcceleration") as e:
        read_recording(files[:2])
    assert e.value.code == "gravity_removed"
