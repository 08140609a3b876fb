"""What detection says about feet that give no, or doubtful, contacts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.errors import Notice, SignalError
from sagittal.core.events import FootPitchParams, detect
from sagittal.core.fusion.orientations import Orientations
from tests.core.events.foot_signal import FINE, cycle_pitch, extremes, foot_pitch, orientations, walk


def codes(events_of: Orientations, params: FootPitchParams | None = None) -> set[str]:
    return {n.code for n in detect(events_of, params).notices}


def test_both_feet_in_order_of_time_with_the_moment_they_are_known() -> None:
    events = detect(walk()).events
    assert len(events) == 48
    assert [e.time_s for e in events] == sorted(e.time_s for e in events)
    latest = {"tc": 0.015, "ic": 0.045}  # a landing is known once the foot has begun to come down
    assert all(0.005 - 1e-9 <= e.detected_s - e.time_s <= latest[e.kind] + 1e-9 for e in events)
    assert {e.source for e in events} == {"foot_pitch"}
    assert not detect(walk()).notices


def test_heading_and_its_drift_change_nothing() -> None:
    t = np.arange(1500) / 100.0
    pitch = foot_pitch(t, 2.0, 8, 1.1)
    straight = detect(orientations(100.0, {"foot_l": pitch}))
    drifting = detect(orientations(100.0, {"foot_l": pitch}, heading=0.3 * t + 2.0))
    a, b = ([e.time_s for e in x.events] for x in (straight, drifting))
    assert np.allclose(a, b, atol=1e-9)


def test_shuffling_feet_are_reported_with_the_measured_pitch() -> None:
    found = detect(walk(scale=0.15))
    assert not found.events
    (left, right) = found.notices
    assert left.code == right.code == "no_toe_off"
    lowest = 0.15 * np.degrees(cycle_pitch(FINE).min())
    assert f"never fell below −11.5° (lowest: −{-lowest:.1f}°)" in left.message


def test_a_foot_that_is_not_level_at_rest_is_suspected() -> None:
    t = np.arange(1500) / 100.0
    tilted = orientations(100.0, {"foot_l": foot_pitch(t, 2.0, 8, 1.1) + np.radians(8.0)})
    assert codes(tilted) == {"foot_missing", "rest_pose_suspect"}
    (notice,) = (n for n in detect(tilted).notices if n.code == "rest_pose_suspect")
    assert "8.0°" in notice.message
    assert notice.sensor == "foot_l"
    low = orientations(100.0, {"foot_l": foot_pitch(t, 2.0, 8, 1.1) - np.radians(40.0)})
    assert "never exceeded 5.7°" in next(
        n.message for n in detect(low).notices if n.code == "rest_pose_suspect"
    )


def test_a_foot_that_drops_in_swing_but_stands_flat_is_not_suspected() -> None:
    t = np.arange(1500) / 100.0
    pitch = foot_pitch(t, 2.0, 8, 1.1)
    dropping = np.where(pitch > 0.0, 0.25 * pitch, pitch)
    assert codes(orientations(100.0, {"foot_l": dropping})) == {"foot_missing"}


def test_a_rate_below_40_hz_is_refused() -> None:
    with pytest.raises(SignalError, match="at least 40 Hz") as error:
        detect(walk(rate_hz=30.0))
    assert error.value.code == "sample_rate_too_low"


def test_without_rest_no_contacts_are_claimed() -> None:
    restless = replace(walk(), notices=(Notice("no_rest", "No second of rest was found."),))
    assert not detect(restless).events
    assert codes(restless) == {"no_rest"}
    one_foot = replace(walk(), notices=(Notice("no_rest", "No rest of this sensor.", "foot_l"),))
    assert {e.side for e in detect(one_foot).events} == {"right"}


def test_a_start_in_swing_hides_the_first_contact() -> None:
    whole = walk()
    true_tc, true_ic = extremes(2.0, 12, 1.1)
    cut = round((true_tc[0] + 0.06) * 100.0)
    late = orientations(100.0, {"foot_r": foot_pitch(whole.t_s, 2.0, 12, 1.1)[cut:]})
    ic = np.array(detect(late).times("right", "ic")) + cut / 100.0
    assert len(ic) == 11
    assert ic[0] == pytest.approx(true_ic[1], abs=0.01)


def test_another_threshold_shows_what_it_found() -> None:
    notices = detect(walk(), FootPitchParams(threshold=-0.1)).notices
    assert [n.code for n in notices] == ["event_threshold_changed"]
    assert "foot_l 12 initial contacts" in notices[0].message


def test_one_foot_and_no_feet_work() -> None:
    both = walk()
    left = replace(both, q={"foot_l": both.q["foot_l"]})
    assert {e.side for e in detect(left).events} == {"left"}
    assert codes(left) == {"foot_missing"}
    lost = replace(both, valid=dict(both.valid) | {"foot_r": np.zeros(len(both.t_s), np.bool_)})
    assert {e.side for e in detect(lost).events} == {"left"}
    assert codes(lost) == {"foot_missing"}
    none = replace(both, q={}, valid={})
    assert not detect(none).events


@pytest.mark.parametrize("n", [1, 2, 5, 17])
def test_a_recording_shorter_than_the_window_gives_no_events(n: int) -> None:
    assert not detect(orientations(100.0, {"foot_l": np.zeros(n)})).events
