"""Unknown tables: their shape, clock, signals and units are told by names and numbers, or left open."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sagittal.core.formats import SourceFile, manifest_of, read_recording
from sagittal.core.formats.table_guess import PIECE, TableLook, look_into_table, make_entry, read_sample
from sagittal.core.frames import GRAVITY
from tests.core.formats.making import signals
from tests.data import data_folder

ACC, GYR = signals(3000, still=300)


def written(header: str, *columns: NDArray[Any], separator: str = ",") -> bytes:
    rows = np.hstack([c if c.ndim == 2 else c[:, None] for c in columns])
    return (header + "\n".join(separator.join(f"{v:.5f}" for v in row) for row in rows) + "\n").encode()


def look(data: bytes, name: str = "walk_left_foot.csv") -> TableLook:
    found = look_into_table(SourceFile.of_bytes(name, data))
    assert found is not None
    return found


def test_names_units_and_clock_are_told() -> None:
    t_ms = 1_700_000_000_000 + 10.0 * np.arange(len(ACC))
    head = "made by us\ntimestamp;ax;acc x (g);acc y (g);acc z (g);gyro_x;gyro_y;gyro_z\n"
    found = look(written(head, t_ms, t_ms * 0, ACC / GRAVITY, np.degrees(GYR), separator=";"))
    assert found.source == {
        "skip_rows": 1,
        "header_rows": 1,
        "separator": ";",
        "time_column": "timestamp",
        "time_unit": "ms",
        "columns": {"*": {"acc": [f"acc {a} (g)" for a in "xyz"], "gyr": [f"gyro_{a}" for a in "xyz"]}},
        "acc_unit": "g",
        "gyr_unit": "deg/s",
    }
    assert len(found.rows) == 6


@pytest.mark.parametrize(
    ("acc_times", "gyr_times", "units"),
    [
        (1.0, 1.0, ("m/s2", "rad/s")),
        (1 / GRAVITY, 180 / np.pi, ("g", "deg/s")),
        (1000 / GRAVITY, 1.0, ("mg", "rad/s")),
        (37.0, 1.0, (None, None)),
    ],
)
def test_units_are_told_by_the_numbers_or_left_open(
    acc_times: float, gyr_times: float, units: tuple[str | None, str | None]
) -> None:
    source = look(written("Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z\n", ACC * acc_times, GYR * gyr_times)).source
    assert (source.get("acc_unit"), source.get("gyr_unit")) == units
    assert "rate_hz" not in source


def test_free_acceleration_and_other_files_are_not_taken_for_a_sensor() -> None:
    found = look(written("FreeAcc_X,FreeAcc_Y,FreeAcc_Z,Gyr_X,Gyr_Y,Gyr_Z\n", ACC, GYR))
    assert found.source["columns"] == {}
    for data in (b"a,b\n1,2\n", b"\x00\x01" * 100, b"", b'{"a": [1, 2]}', b"text\nmore text\n"):
        assert look_into_table(SourceFile.of_bytes("x", data)) is None


def test_only_the_head_of_a_long_table_is_read() -> None:
    data = written("Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z\n", ACC, GYR) * 90
    assert len(data) > 2 * PIECE
    most: list[int] = []

    class Watched(SourceFile):
        def open(self) -> Any:
            opened = super().open()
            most.append(0)
            plain = opened.read

            def read(n: int = -1) -> bytes:
                got = plain(n)
                most[-1] += len(got)
                return got

            opened.read = read  # type: ignore[method-assign]
            return opened

    file = Watched("x.csv", len(data), lambda: data)
    found = look_into_table(file)
    assert found is not None
    entry = make_entry({**found.source, "rate_hz": 100}, "x.csv")
    (draft,) = read_sample(file, manifest_of({"sources": [entry]}).sources[0])
    assert 1000 < len(draft.acc) < 90 * len(ACC) / 2
    assert max(most) == PIECE


REAL: list[tuple[tuple[str, ...], dict[str, Any], tuple[str, ...]]] = [
    (
        ("ipol_walks", "12-3_lf.txt"),
        {"skip_rows": 1, "rate_hz": 100.0, "counter": {"column": "PacketCounter"}, "acc_unit": "m/s2"},
        ("*",),
    ),
    (
        ("gaitmap_foot", "imu_sample.csv"),
        {"header_rows": 2, "acc_unit": "m/s2", "gyr_unit": "deg/s"},
        ("left_sensor", "right_sensor"),
    ),
    (
        ("formats", "mobilised", "HA001_TimeMeasure1_Test5_Trial1.csv"),
        {"counter": {"column": "samples"}, "acc_unit": "g", "gyr_unit": "deg/s"},
        ("*",),
    ),
    (("neura_walk", "imu", "S02-Trial-Walk-1-Pelvis.csv"), {"skip_rows": 4, "rate_hz": 100.0}, ("*",)),
]


@pytest.mark.recorded
@pytest.mark.parametrize(("path", "expected", "sensors"), REAL, ids=[r[0][-1] for r in REAL])
def test_tables_of_laboratories_are_understood(
    path: tuple[str, ...], expected: dict[str, Any], sensors: tuple[str, ...]
) -> None:
    file = SourceFile.of_path(data_folder(*path))
    found = look_into_table(file)
    assert found is not None
    assert {key: found.source.get(key) for key in expected} == expected
    assert tuple(found.source["columns"]) == sensors
    entry = make_entry({"rate_hz": 100, **found.source}, file.name)
    recording = read_recording([file], manifest_of({"sources": [entry]}))
    for stream in recording.streams.values():
        assert np.nanmedian(np.linalg.norm(stream.acc, axis=1)) == pytest.approx(GRAVITY, rel=0.2)


def test_equal_titles_are_of_several_sensors_and_equal_clocks_are_left_open() -> None:
    t_s = 0.01 * np.arange(len(ACC))
    head = "time,acc_x,acc_y,acc_z,time,acc_x,acc_y,acc_z\n"
    found = look(written(head, t_s, ACC, 2.5 * t_s, -ACC))
    assert found.names == (*(f"{n}#1" for n in head.split(",")[:4]), *(f"{n}#2" for n in head.split(",")[:4]))
    assert found.source["columns"] == {
        f"sensor {k}": {"acc": [f"acc_{a}#{k}" for a in "xyz"]} for k in (1, 2)
    }
    assert "time_column" not in found.source


def test_the_number_of_a_channel_is_not_its_axis() -> None:
    t_s = 0.01 * np.arange(len(ACC))
    titles = [
        f"L FOOT: {kind}.{axis} 1 [{unit}]"
        for kind, unit in (("ACC", "g"), ("GYRO", "dps"))
        for axis in "XYZ"
    ]
    columns = [c for k in range(6) for c in (t_s, np.c_[ACC / GRAVITY, np.degrees(GYR)][:, k])]
    source = look(written(",".join(f"X [s],{t}" for t in titles) + "\n", *columns)).source
    assert source["columns"] == {"L FOOT": {"acc": titles[:3], "gyr": titles[3:]}}
    assert (source["acc_unit"], source["gyr_unit"]) == ("g", "deg/s")
