"""Placement by declaration, name or movement, or no suggestion."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sagittal.core.frames import Segment
from sagittal.core.quality.suggestion import Suggestion, suggest, suggest_segments
from sagittal.core.signals.recording import ImuStream, Recording
from sagittal.core.simulate import simulate_scenario
from tests.core.formats.making import signals, stream
from tests.core.quality.nine_sensors import NINE

ACC, GYR = signals(2000, still=500)


def nameless(recording: Recording) -> tuple[Recording, dict[str, Segment]]:
    """The same sensors without names or mapping, and their true segments."""
    ids = {d: f"id{i}" for i, d in enumerate(recording.streams)}
    streams = {ids[d]: replace(s, device_id=ids[d], source="x") for d, s in recording.streams.items()}
    return Recording(streams, {}), {ids[d]: s for d, s in recording.segments.items() if s}


@pytest.mark.recorded
def test_movement_sorts_nine_real_sensors_and_sets_ankles_and_copies_aside(neura: Recording) -> None:
    segments = suggest_segments(Recording(neura.streams, {}))
    assert segments == {d: NINE.get(d) for d in neura.streams}


@pytest.mark.sweep
@pytest.mark.parametrize("script", ["comfortable", "fast_with_turns", "slow"])
def test_movement_tells_segments_and_sides_of_simulated_walks(script: str) -> None:
    recording, truth = nameless(simulate_scenario(script, seed=1).recording)
    assert suggest_segments(recording) == truth


@pytest.mark.recorded
def test_a_walk_without_rest_before_it_has_legs_but_no_sides(neura: Recording) -> None:
    walk = slice(1250, 2150)
    cut = {
        d: replace(
            s,
            t_s=s.t_s[walk],
            acc=s.acc[walk],
            gyr=None if s.gyr is None else s.gyr[walk],
            mag=None,
            quat=None,
        )
        for d, s in neura.streams.items()
    }
    suggestion = suggest(Recording(cut, {}))
    assert {s.segment for s in suggestion.values()} == {None, "pelvis"}
    parts = {d: (s.part, s.leg) for d, s in suggestion.items()}
    assert {parts[d][0] for d in ("00B40C55", "00B40C48")} == {"foot"}
    legs = {(parts[d][1], segment[-1]) for d, segment in NINE.items() if segment and "_" in segment}
    assert len(legs) == 2


@pytest.mark.recorded
def test_movement_says_nothing_about_people_who_stand(neura: Recording) -> None:
    still = {
        d: ImuStream(
            d, s.source, s.t_s[:1000], s.acc[:1000], None if s.gyr is None else s.gyr[:1000], None, None,
            100.0, "counter", d,
        )
        for d, s in neura.streams.items()
    }  # fmt: skip
    assert set(suggest_segments(Recording(still, {})).values()) == {None}


def test_names_are_believed_before_movement() -> None:
    names = ("LTibia_2021", "Pelvis", "box", "pelvis 2")
    streams = {name: stream(name, ACC + i, GYR) for i, name in enumerate(names)}
    segments = suggest_segments(Recording(streams, {}))
    assert segments == {"LTibia_2021": "shank_l", "Pelvis": None, "box": None, "pelvis 2": None}
    streams.pop("pelvis 2")
    assert suggest_segments(Recording(streams, {}))["Pelvis"] == "pelvis"


@pytest.mark.recorded
def test_a_declared_mapping_is_kept_as_the_suggestion(neura: Recording) -> None:
    suggestion = suggest(neura)
    assert {suggestion[d].segment for d in NINE} == set(NINE.values())
    assert suggestion["00B40C55"].basis == "declared"


def test_two_sensors_that_name_their_side_alone_are_taken_for_the_feet() -> None:
    pair = Recording({d: stream(d, ACC, GYR) for d in ("left_sensor", "right_sensor")}, segments={})
    assert suggest(pair) == {
        "left_sensor": Suggestion("foot_l", "label", "foot"),
        "right_sensor": Suggestion("foot_r", "label", "foot"),
    }
    for devices in (("left_a", "left_b"), ("left_a", "right_b", "c"), ("a", "b")):
        assert set(
            suggest_segments(Recording({d: stream(d, ACC, GYR) for d in devices}, segments={})).values()
        ) == {None}


def test_a_declared_sensor_takes_its_segment_from_those_that_only_have_its_name() -> None:
    streams = {d: stream(d, ACC + i, GYR) for i, d in enumerate(("one", "Pelvis", "LTibia", "spare"))}
    suggestion = suggest(Recording(streams, {"one": "pelvis", "spare": None}))
    assert suggestion == {
        "one": Suggestion("pelvis", "declared", "pelvis"),
        "Pelvis": Suggestion(),
        "LTibia": Suggestion("shank_l", "label", "shank"),
        "spare": Suggestion(None, "declared"),
    }
