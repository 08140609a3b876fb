"""Monitor results survive their files unchanged, and pass through the whole analysis."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest

from sagittal.core.errors import FormatError, SignalError
from sagittal.core.formats import SourceFile, write_recording
from sagittal.core.pipeline import analyse
from sagittal.core.signals.recording import Recording
from sagittal.core.simulate.daily import plan_daily_life, record_daily_life, simulate_daily_life
from sagittal.server.report.files import activity_files
from sagittal.server.report.files.activity_files import read_activity, write_activity
from sagittal.server.report.files.bundle import load_bundle
from sagittal.server.results import analysing


@pytest.fixture(scope="module")
def recording() -> Recording:
    return record_daily_life(simulate_daily_life(plan_daily_life(0.4, 8), seed=8))


@pytest.fixture(scope="module")
def files(recording: Recording) -> dict[str, bytes]:
    stages: list[str] = []
    source = SourceFile.of_bytes("day.parquet", write_recording(recording))
    result = analysing.run([source], None, None, lambda stage, share: stages.append(stage))
    assert stages == ["reading", "activity", "quality", "done"]
    return result


def test_everything_comes_back(recording: Recording) -> None:
    activity = analyse(recording).activity
    assert activity is not None
    second_activity = read_activity(write_activity(activity))
    for name in vars(activity):
        if name in ("steps_s", "inclination_deg", "turns"):
            continue
        assert getattr(second_activity, name) == getattr(activity, name), name
    assert second_activity.steps_s.tobytes() == activity.steps_s.tobytes()
    assert np.allclose(second_activity.inclination_deg, activity.inclination_deg, atol=1e-4, equal_nan=True)


def test_the_job_writes_what_pages_and_downloads_read(files: dict[str, bytes]) -> None:
    bundle = load_bundle(files)
    assert bundle.quality["level"] == "good"
    assert {p.name for p in bundle.parameters} >= {"daily_step_count", "daily_rise_count"}
    assert bundle.provenance["parameters_sha256"]
    day = json.loads(files[activity_files.NAME])
    rows = list(csv.DictReader(io.StringIO(files["activity_spans.csv"].decode())))
    assert {row["kind"] for row in rows} <= set(day["minutes"])
    hours = list(csv.DictReader(io.StringIO(files["activity_hours.csv"].decode())))
    assert sum(int(row["steps"]) for row in hours) == day["steps"] > 0


def test_without_a_sensor_on_the_trunk_it_is_said_where_one_is_needed(recording: Recording) -> None:
    source = SourceFile.of_bytes("day.parquet", write_recording(recording))
    (device,) = recording.streams
    manifest = json.dumps({"sensors": {device: "foot_l"}}).encode()
    with pytest.raises(SignalError, match="chest or lower back") as error:
        analysing.run([source], manifest, None, lambda stage, share: None)
    assert error.value.code == "no_trunk_sensor"


def test_missing_and_newer_files_are_refused(files: dict[str, bytes]) -> None:
    with pytest.raises(FormatError) as error:
        read_activity({})
    assert error.value.code == "no_activity"
    newer = {**files, activity_files.NAME: b'{"schema": 99}'}
    with pytest.raises(FormatError) as error:
        read_activity(newer)
    assert error.value.code == "newer_activity"
