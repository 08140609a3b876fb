"""Signals of a finished analysis, thinned for display."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.server.errors import NotFound
from sagittal.server.results import analyses
from sagittal.server.results.analyses import AnalysisRecord
from sagittal.server.results.signals import MOST_POINTS, SignalWindow, _extremes, list_lanes, read_window
from tests.helpers.clinic import Clinic
from tests.server import analysed, feedback


def test_parts_have_their_least_and_greatest_value_the_last_part_is_shorter() -> None:
    low, high = _extremes(np.array([1.0, 3.0, -2.0, 0.0, 5.0]), 2)
    assert (low, high) == ([1.0, -2.0, 5.0], [3.0, 0.0, 5.0])


def test_a_lost_sample_hides_nothing_and_a_lost_part_is_none() -> None:
    low, high = _extremes(np.array([np.nan, 3.0, np.nan, np.nan]), 2)
    assert (low, high) == ([3.0, None], [3.0, None])
    same, second = _extremes(np.array([0.12349, np.nan, np.inf]), 1)
    assert same == second == [0.123, None, None]


@pytest.fixture(scope="module")
def found(stored: Clinic) -> AnalysisRecord:
    session = feedback.walked(stored, feedback.person(stored), 0, 12.0)
    with stored.db.read() as c:
        return analyses.get_shown(c, session)


def window(
    stored: Clinic, result: AnalysisRecord, name: str, start_s: float, end_s: float, points: int
) -> SignalWindow:
    return read_window(stored.app.state.reviewed, result, name, start_s, end_s, points)


def test_feet_come_first_then_joints_then_sensors(stored: Clinic, found: AnalysisRecord) -> None:
    lanes = list_lanes(stored.app.state.reviewed, found)
    names = [lane.name for lane in lanes]
    assert names[:4] == ["foot_pitch", "foot_rate", "foot_acceleration", "foot_height"]
    assert {tuple(names[-6:-4]), tuple(names[-4:-2]), tuple(names[-2:])} == {
        (f"{segment}_gyr", f"{segment}_acc") for segment in ("pelvis", "foot_l", "foot_r")
    }
    raw = [lane.raw for lane in lanes]
    assert raw == sorted(raw)
    by_name = {lane.name: lane for lane in lanes}
    assert by_name["knee_flexion"].lines == ("left", "right")
    assert by_name["pelvis_tilt"].lines == ("both",)
    assert by_name["pelvis_acc"].lines == ("x", "y", "z")
    assert (by_name["foot_rate"].unit, by_name["pelvis_acc"].unit) == ("°/s", "m/s²")


def test_a_window_has_the_samples_in_it_and_the_one_behind_each_end(
    stored: Clinic, found: AnalysisRecord
) -> None:
    # 100 samples per second
    got = window(stored, found, "knee_flexion", 1.0, 1.1, MOST_POINTS)
    assert [got.start_s, got.step_s] == pytest.approx([1.0, 0.01])
    assert len(got.low["left"]) in {11, 12}
    assert got.low == got.high
    angles = stored.app.state.reviewed.open(found).bundle.angles
    assert got.low["left"][0] == pytest.approx(np.degrees(angles.angles["knee_flexion_l"][100]), abs=1e-3)


def test_a_wide_window_is_thinned_and_loses_no_peak(stored: Clinic, found: AnalysisRecord) -> None:
    whole = window(stored, found, "knee_flexion", -5.0, 100.0, MOST_POINTS)
    thin = window(stored, found, "knee_flexion", -5.0, 100.0, 7)
    assert (whole.start_s, thin.start_s) == (0.0, 0.0)
    assert len(thin.high["left"]) == 7
    assert thin.step_s == pytest.approx(np.ceil(len(whole.high["left"]) / 7) / 100)
    assert max(x or 0.0 for x in thin.high["left"]) == max(x or 0.0 for x in whole.high["left"])
    assert min(x or 0.0 for x in thin.low["right"]) == min(x or 0.0 for x in whole.low["right"])


def test_a_window_beyond_the_end_is_the_last_sample(stored: Clinic, found: AnalysisRecord) -> None:
    got = window(stored, found, "foot_height", 50.0, 60.0, 10)
    assert [len(values) for values in got.low.values()] == [1, 1]
    assert got.start_s == pytest.approx(11.99)


def test_the_foot_turns_about_the_axis_of_its_segment_less_the_bias(
    stored: Clinic, found: AnalysisRecord
) -> None:
    rate = window(stored, found, "foot_rate", 2.0, 3.0, MOST_POINTS)
    raw = window(stored, found, "foot_l_gyr", 2.0, 3.0, MOST_POINTS)
    # the sensor lies as its segment does, and the bias about that axis is not known
    assert rate.low["left"] == raw.low["z"]
    strength = window(stored, found, "foot_acceleration", 2.0, 3.0, MOST_POINTS)
    assert set(strength.low["left"]) == {0.0}


def test_a_lane_that_is_not_there_is_not_found(stored: Clinic, found: AnalysisRecord) -> None:
    with pytest.raises(NotFound, match="moonwalk"):
        window(stored, found, "moonwalk", 0.0, 1.0, 10)


def test_an_analysis_without_signals_still_has_its_angles(stored: Clinic) -> None:
    patient = feedback.person(stored)
    session = feedback.visit(stored, patient, 0)
    retained = {n: x for n, x in analysed.files().items() if n not in {"signals.parquet", "tracks.parquet"}}
    analysed.finish(stored, patient, session, retained)
    with stored.db.read() as c:
        bare = analyses.get_shown(c, session)
    lanes = list_lanes(stored.app.state.reviewed, bare)
    assert "knee_flexion" in {lane.name for lane in lanes}
    assert not any(lane.raw or lane.name.startswith("foot_") for lane in lanes)
