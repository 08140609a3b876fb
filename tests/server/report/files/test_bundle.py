"""Analysis files are read back unchanged."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from sagittal.core.errors import FormatError
from sagittal.core.parameters.temporal import stride_values
from sagittal.server.report.files.bundle import load_bundle, read_angles, read_poses
from sagittal.server.report.files.exports import analysis_files, angles_parquet
from tests.server import walk
from tests.server.analysed import analysis


@pytest.fixture(scope="module")
def files() -> Mapping[str, bytes]:
    return analysis_files(analysis())


def test_names_of_the_files(files: Mapping[str, bytes]) -> None:
    assert set(files) == {
        *("analysis.json", "events.csv", "strides.csv"),
        *(f"{name}.parquet" for name in ("angles", "poses", "tracks", "signals")),
    }


def test_analysis_json_is_strict_json_of_schema_1(files: Mapping[str, bytes]) -> None:
    def refuse(token: str) -> Any:
        raise AssertionError(f"{token} on the wire")

    data = json.loads(files["analysis.json"], parse_constant=refuse)
    assert data["schema"] == 1
    assert set(data) == {
        "schema",
        "quality",
        "devices",
        "setup",
        "agreement",
        "calibration",
        "body",
        "calibration_score",
        "sensor_places",
        "functional",
        "estimator",
        "parameters",
        "scores",
        "mean_curves",
        "walking",
        "warnings",
        "provenance",
    }
    assert data["calibration"]["segments"]["pelvis"]["gyro_bias_dps"][2] is None
    assert data["calibration"]["segments"]["pelvis"]["forward_sd_deg"] == pytest.approx(np.degrees(0.05))
    assert data["warnings"][0] | {"code": "gap", "sensor": "pelvis", "t_s": 1.0} == data["warnings"][0]
    row = next(p for p in data["parameters"] if p["name"] == "stride_time_s" and p["side"] == "left")
    assert row["mean"] == pytest.approx(walk.STRIDE_S)
    assert set(row) == {
        *("name", "side", "n", "mean", "sd", "unit", "reason"),
        *("cv_pct", "ci_low", "ci_high", "note", "uncertainty", "u_own", "u_common", "estimated"),
    }


def test_angles_parquet_is_float32_degrees_with_null_where_lost() -> None:
    angles = walk.angles()
    angles.angles["knee_flexion_l"][100:120] = np.nan
    lost = analysis()
    object.__setattr__(lost, "angles", angles)
    table = pq.read_table(io.BytesIO(analysis_files(lost)["angles.parquet"]))
    column = table.column("knee_flexion_l_deg")
    assert str(column.type) == "float"
    assert column.null_count == 20
    assert table.column("t_s").null_count == 0
    assert column[0].as_py() == pytest.approx(math.degrees(angles.angles["knee_flexion_l"][0]), abs=1e-4)


def test_goniometer_angles_go_with_the_angles() -> None:
    entered = {"knee_flexion_l": 8.0, "pelvis_tilt": 11.5}
    assert read_angles(angles_parquet(replace(walk.angles(), standing_deg=entered))).standing_deg == entered
    assert read_angles(angles_parquet(walk.angles())).standing_deg == {}


def test_headings_go_with_the_angles_and_are_no_angles() -> None:
    turning = walk.angles()
    course = np.linspace(0.0, 20.0, len(turning.t_s))
    back = read_angles(angles_parquet(replace(turning, headings={"pelvis": course, "foot_l": -course})))
    assert set(back.angles) == set(turning.angles)
    assert set(back.headings) == {"pelvis", "foot_l"}
    np.testing.assert_allclose(back.headings["pelvis"], course, atol=1e-5)


def test_bundle_gives_back_angles_strides_events_and_parameters(files: Mapping[str, bytes]) -> None:
    bundle, source = load_bundle(files), analysis()
    assert bundle.angles is not None
    assert source.angles is not None
    for name, angle in source.angles.angles.items():
        np.testing.assert_allclose(bundle.angles.angles[name], angle, atol=1e-6)
    assert bundle.angles.zero_offset == pytest.approx(source.angles.zero_offset)
    assert bundle.parameters == source.parameters
    assert source.strides is not None
    assert len(bundle.strides.strides) == len(source.strides.strides)
    for read, written in zip(bundle.strides.strides, source.strides.strides, strict=True):
        assert (read.side, read.excluded_reason) == (written.side, written.excluded_reason)
        assert read.flags == written.flags
        assert read.start_s == pytest.approx(written.start_s, abs=1e-6)
        assert read.turn_rad == pytest.approx(written.turn_rad, abs=1e-6)
    assert source.events is not None
    assert [(e.side, e.kind) for e in bundle.events.events] == [
        (e.side, e.kind) for e in source.events.events
    ]


def test_poses_come_back_within_float32(files: Mapping[str, bytes]) -> None:
    read, written = read_poses(files["poses.parquet"]), walk.poses()
    assert read.body == written.body
    for segment, q in written.q.items():
        np.testing.assert_allclose(read.q[segment], q, atol=1e-6)
        np.testing.assert_allclose(read.p[segment], written.p[segment], atol=1e-5)
    np.testing.assert_array_equal(read.contact["foot_l"], written.contact["foot_l"])


def test_strides_csv_carries_the_parameters_of_each_stride(files: Mapping[str, bytes]) -> None:
    header, first, *_ = files["strides.csv"].decode().splitlines()
    columns = header.split(",")
    assert columns[:4] == ["side", "start_s", "tc_s", "end_s"]
    assert columns[-1] == "excluded_reason"
    assert set(stride_values(walk.strides().strides[0])) <= set(columns)
    assert "knee_flexion_rom_deg" in columns
    assert "nan" not in first.lower()


def test_an_analysis_that_stopped_early_still_says_why() -> None:
    files = analysis_files(analysis(reached=False))
    assert set(files) == {"analysis.json", "signals.parquet"}
    bundle = load_bundle(files)
    assert bundle.angles is None
    assert bundle.calibration is None
    assert bundle.warnings[-1].code == "no_rest"
    assert bundle.warnings[-1].severity == "error"


@pytest.mark.parametrize(
    ("content", "code"), [({}, "no_analysis"), ({"analysis.json": b'{"schema": 2}'}, "newer_analysis")]
)
def test_a_bundle_that_cannot_be_read_says_what_to_do(content: dict[str, bytes], code: str) -> None:
    with pytest.raises(FormatError) as caught:
        load_bundle(content)
    assert caught.value.code == code
