"""Preselected segments on the upload page and their sources."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from sagittal.server.clinic.devices import LastPlaces
from sagittal.server.pages.uploads.upload import fits_movement, view_inspection
from sagittal.server.uploads.recordings import StoredRecording
from sagittal.web.language import load_catalogue


def device(name: str, part: str | None = None, leg: int | None = None, **more: Any) -> dict[str, Any]:
    return {
        "device_id": name,
        "rate_hz": 100.0,
        "clock": "counter",
        "duration_s": 25.0,
        "lost_pct": 0.0,
        "longest_gap_s": 0.0,
        "has_gyro": True,
        "has_mag": True,
        "has_orientation": False,
        "still_norm_mps2": 9.8,
        "declared": False,
        "segment": None,
        "suggested": "pelvis" if part == "pelvis" else None,
        "suggested_part": part,
        "suggested_leg": leg,
        "basis": "movement" if part else None,
        "duplicate_of": None,
        "notices": [],
    } | more


WALKER = [device("P", "pelvis"), device("A", "foot", 1), device("B", "foot", 2), device("C", "shank", 1)]
RIGHT_WAY = {"P": "pelvis", "A": "foot_r", "B": "foot_l", "C": "shank_r"}


def recording(devices: list[dict[str, Any]], manifest: Mapping[str, Any] | None = None) -> StoredRecording:
    result = {"devices": devices, "duration_s": 25.0, "protocol": "walk", "notices": []}
    return StoredRecording("r", "s", "p", "ready", (), manifest, result, None)


def chosen(view: Mapping[str, Any]) -> dict[str, str | None]:
    return {s["id"]: s["segment"] for s in view["sensors"]}


def test_a_leg_without_a_known_side_is_tried_and_asked_for() -> None:
    view = view_inspection(recording(WALKER), {})
    assert chosen(view) == {"P": "pelvis", "A": "foot_l", "B": "foot_r", "C": "shank_l"}
    assert view["ask_sides"]


def test_an_earlier_visit_that_fits_the_movement_is_taken_over_without_a_question() -> None:
    view = view_inspection(recording(WALKER), RIGHT_WAY)
    assert chosen(view) == RIGHT_WAY
    assert not view["ask_sides"]


@pytest.mark.parametrize(
    "earlier",
    [
        {**RIGHT_WAY, "A": "shank_r", "C": "foot_r"},  # foot and shank exchanged since
        {**RIGHT_WAY, "C": "shank_l"},  # one leg on two sides
        {"P": "pelvis", "A": "foot_r", "B": "foot_r"},  # two legs on one side
        {**RIGHT_WAY, "Z": "thigh_l"},  # a sensor that is not in this upload
        {},
    ],
)
def test_an_earlier_visit_that_contradicts_the_movement_is_not(earlier: dict[str, str | None]) -> None:
    assert not fits_movement(WALKER, earlier)
    assert view_inspection(recording(WALKER), earlier)["ask_sides"]


LAST = LastPlaces({"P": "pelvis", "A": "foot_r", "B": "foot_l"}, dt.date(2026, 5, 3))


def test_the_clinics_last_take_goes_before_movement_and_is_said() -> None:
    view = view_inspection(recording(WALKER), {}, LAST)
    assert chosen(view) == {**LAST.segments, "C": None}
    assert view["as_before"] == {"count": 3, "day": LAST.day, "of_patient": False}
    assert not view["ask_sides"]


def test_a_patients_own_last_visit_goes_before_the_clinics() -> None:
    left_first = LastPlaces({"P": "pelvis", "A": "foot_l", "B": "foot_r"}, LAST.day)
    view = view_inspection(recording(WALKER), RIGHT_WAY, left_first)
    assert chosen(view) == RIGHT_WAY
    assert view["as_before"] == {"count": 4, "day": None, "of_patient": True}


@pytest.mark.parametrize(
    "devices",
    [
        [device("A", "shank", 1), *WALKER[:1], *WALKER[2:]],  # it moves like another segment
        [
            device("A", "foot", suggested="foot_l", basis="label"),
            *WALKER[:1],
            *WALKER[2:],
        ],  # its name says so
        [*WALKER, device("D", "foot", suggested="foot_r", basis="label")],  # another sensor's name says so
    ],
)
def test_the_clinics_last_take_counts_as_a_whole_or_not_at_all(devices: list[dict[str, Any]]) -> None:
    view = view_inspection(recording(devices), {}, LAST)
    assert view["as_before"] is None
    assert chosen(view)["A"] != "foot_r"


def test_a_name_that_agrees_leaves_the_rest_to_the_last_take() -> None:
    devices = [device("A", "foot", suggested="foot_r", basis="label"), device("B"), device("P")]
    view = view_inspection(recording(devices), {}, LAST)
    assert chosen(view) == dict(LAST.segments)
    assert view["as_before"]["count"] == 2


def test_what_a_person_has_set_goes_before_everything() -> None:
    manifest = {"sensors": {"A": "foot_l", "B": None}}
    view = view_inspection(recording(WALKER, manifest), RIGHT_WAY, LAST)
    assert chosen(view)["A"] == "foot_l"
    assert chosen(view)["B"] is None


def test_copies_are_said_in_one_sentence_and_not_used() -> None:
    devices = [*WALKER, device("A2", duplicate_of="A"), device("B2", duplicate_of="B")]
    view = view_inspection(recording(devices), {})
    assert chosen(view)["A2"] is None
    (notice,) = view["notices"]
    assert notice["title"] == "2 sensors are copies of others"
    assert "“A2” of “A”, “B2” of “B”" in notice["message"]
    assert ("Sensors", "4", "and 2 copies") in view["facts"]


def test_what_was_found_is_german_too() -> None:
    """The length of a take was called by the word for a length of the body, its signals stayed English."""
    facts = view_inspection(recording([device("A", has_mag=True, has_orientation=True)]), {})["facts"]
    say = load_catalogue("de").translate
    german = {say(name): say(value) for name, value, _ in facts}
    assert german["Dauer"] == "25,0 s"
    assert german["Signale"] == "Beschleunigung, Gyroskop, Magnetometer, Orientierung"


def test_grave_notices_come_first_and_only_once() -> None:
    def notice(code: str, severity: str) -> dict[str, Any]:
        return {"code": code, "message": code, "sensor": None, "t_s": None, "severity": severity}

    noisy = [
        device("A", notices=[notice("some_info", "info"), notice("units", "warning")]),
        device("B", has_gyro=False, notices=[notice("units", "warning"), notice("no_gyro", "error")]),
    ]
    view = view_inspection(recording(noisy), {})
    assert [n["kind"] for n in view["notices"]] == ["bad", "warn", ""]
    assert [s["state"]["kind"] for s in view["sensors"]] == ["warn", "bad"]


def test_files_that_were_not_used_are_one_list_beside_the_notices() -> None:
    def about(code: str, name: str, severity: str) -> dict[str, Any]:
        return {"code": code, "message": f"{name} …", "sensor": None, "t_s": None, "severity": severity}

    result = recording(WALKER)
    assert result.inspection is not None
    notices = [
        about("ignored_file", "README.md", "info"),
        about("file_not_read", "angles.csv", "warning"),
        about("gap", "pelvis", "warning"),
    ]
    view = view_inspection(replace(result, inspection={**result.inspection, "notices": notices}), {})
    assert view["unused"] == ["README.md …", "angles.csv …"]
    assert [n["message"] for n in view["notices"]] == ["pelvis …"]
