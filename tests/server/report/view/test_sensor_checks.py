"""Clock and placement of each sensor on the data page."""

from __future__ import annotations

from typing import Any

from sagittal.server.report.view.sensor_checks import NOT_JUDGED, sensor_checks


def sensor(name: str, **changes: Any) -> dict[str, Any]:
    return {
        "sensor": name,
        "clock_judged": True,
        "lag_ms": None,
        "drift_ms": None,
        "shifted": False,
        "clock_doubted": False,
        "place_judged_s": [14.2, 21.4],
        "slip_deg": None,
        "slip_at_s": None,
        **changes,
    }


def found(*sensors: dict[str, Any], exchanged: list[list[str]] | None = None) -> dict[str, Any]:
    return {"exchanged": exchanged or [], "sensors": list(sensors)}


def test_a_pelvis_is_said_to_be_beyond_judging_and_is_no_warning() -> None:
    view = sensor_checks(found(sensor("pelvis", place_judged_s=None), sensor("thigh_r")))
    assert view is not None
    pelvis, thigh = view.rows
    assert (pelvis.sensor, pelvis.place, pelvis.place_kind) == ("Pelvis", f"Placement {NOT_JUDGED}", "")
    assert (thigh.place, thigh.place_kind) == ("Stable from 14 to 21\u202fs", "ok")
    assert sum("pelvis sensor cannot be detected" in n for n in view.notes) == 1


def test_an_older_analysis_does_not_vouch_for_a_place() -> None:
    old = {k: x for k, x in sensor("foot_l").items() if k != "place_judged_s"}
    view = sensor_checks(found({**old, "place_judged": True}, sensor("foot_r")))
    assert view is not None
    assert [r.place for r in view.rows] == [f"Placement {NOT_JUDGED}", "Stable from 14 to 21\u202fs"]


def test_what_was_found_stands_in_its_row() -> None:
    view = sensor_checks(
        found(
            sensor("shank_l", lag_ms=-41.0, shifted=True),
            sensor("foot_l", slip_deg=-14.2, slip_at_s=31.6),
            sensor("foot_r", drift_ms=33.0),
            sensor("thigh_l", clock_judged=False, clock_doubted=True),
            exchanged=[["shank_l", "shank_r"]],
        )
    )
    assert view is not None
    assert view.exchanged == "left shank and right shank"
    assert view.rows[0].clock == "Clock 41\u202fms early, corrected"
    assert view.rows[1].place == "Slipped 14° about 32\u202fs"
    assert view.rows[2].clock == "Clock runs slow, 33\u202fms over the trial, not corrected"
    assert view.rows[3].clock == "Clock appears wrong, see notices"
    assert {r.clock_kind for r in (view.rows[0], view.rows[2], view.rows[3])} == {"warn"}


def test_a_sensor_without_a_neighbour_is_judged_in_nothing() -> None:
    single = sensor("foot_l", clock_judged=False, place_judged_s=None)
    view = sensor_checks(found(single, {**single, "sensor": "foot_r"}))
    assert view is not None
    assert (view.rows[0].clock, view.rows[0].place) == (f"Clock {NOT_JUDGED}", f"Placement {NOT_JUDGED}")
    assert not any("pelvis" in n or "loosen" in n for n in view.notes)
    assert sensor_checks(found(single)) is None
    assert sensor_checks(None) is None
