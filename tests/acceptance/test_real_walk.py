"""The walk that comes with the project, from file to report: two IMUs on the shoes of a real person."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sagittal.core.frames import SIDES, Side
from tests.acceptance.test_cli import rows, sagittal
from tests.data import ROOT

FOLDER = ROOT / "tests" / "data" / "gaitmap_foot"
RATE_HZ = 204.8
MANIFEST: dict[str, Any] = {
    "protocol": "walk",
    "sources": [
        {
            "file": "imu_sample.csv",
            "header_rows": 2,
            "index_column": True,
            "rate_hz": RATE_HZ,
            "acc_unit": "m/s2",
            "gyr_unit": "deg/s",
            "gravity_included": True,
            "columns": {
                f"foot_{side[0]}": {
                    "acc": [f"{side}_sensor/acc_{axis}" for axis in "xyz"],
                    "gyr": [f"{side}_sensor/gyr_{axis}" for axis in "xyz"],
                    "mag": None,
                }
                for side in SIDES
            },
        }
    ],
}


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the command line makes of it."""
    folder = tmp_path_factory.mktemp("real")
    (folder / "manifest.json").write_text(json.dumps(MANIFEST), "utf-8")
    done = sagittal(
        "analyse", FOLDER / "imu_sample.csv", "--manifest", folder / "manifest.json", "--out", folder / "out"
    )
    assert done.returncode == 0, done.stderr
    return folder / "out"


def contacts_by_motion_capture(side: Side) -> list[float]:
    """Initial contacts of the reference strides, s."""
    with (FOLDER / "stride_events_sample.csv").open(newline="") as file:
        return [float(r["ic"]) / RATE_HZ for r in csv.DictReader(file) if r["foot"] == side]


@pytest.mark.parametrize("side", SIDES)
def test_contacts_are_those_of_motion_capture(results: Path, side: Side) -> None:
    found = [
        float(e["time_s"]) for e in rows(results / "events.csv") if (e["side"], e["kind"]) == (side, "ic")
    ]
    reference = contacts_by_motion_capture(side)
    errors = [min((t - r for t in found), key=abs) for r in reference]
    hits = np.array([e for e in errors if abs(e) < 0.25])
    assert len(hits) >= len(reference) - 1
    assert abs(hits.mean()) <= 0.025
    assert hits.std() <= 0.015


def test_strides_are_as_many_and_as_long_as_they_were(results: Path) -> None:
    counted = [s for s in rows(results / "strides.csv") if not s["excluded_reason"]]
    lengths = [float(s["stride_length_m"]) for s in counted if s["stride_length_m"]]
    assert len(counted) >= 40
    assert len(lengths) >= 40
    assert 1.30 < np.mean(lengths) < 1.45, "motion capture: 1.34 m over all, 1.375 m on the straight"


def test_what_feet_alone_cannot_say_is_withheld_with_a_reason(results: Path) -> None:
    parameters = json.loads((results / "analysis.json").read_text("utf-8"))["parameters"]
    withheld = {p["name"]: p["reason"] for p in parameters if p["mean"] is None}
    assert withheld["stride_regularity_ap"] == "no_pelvis_sensor"
    assert withheld["step_width_m"]
