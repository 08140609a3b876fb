"""Places of sensors and joints as the calibration page shows them."""

from __future__ import annotations

from typing import Any

from sagittal.server.report.view.sensor_places import view_sensor_places

STORED: dict[str, Any] = {
    "sensors": {
        "foot_l": {
            "guess_cm": [7.0, -3.0, 0.0],
            "cm": [8.0, -0.5, -2.0],
            "sd_cm": [0.7, 0.7, 0.8],
            "measured": [True, True, True],
        },
        "thigh_l": {
            "guess_cm": [6.0, -20.0, -6.0],
            "cm": [6.0, -20.0, -6.0],
            "sd_cm": [3.0, 6.0, 3.0],
            "measured": [False, False, False],
        },
    },
    "joints": {
        "shank_l-foot_l": {
            "joint": "ankle",
            "segment": "shank_l",
            "side": "left",
            "guess_cm": [0.0, -41.8, 0.0],
            "cm": [-1.2, -41.5, 0.1],
            "sd_cm": [1.1, 1.2, 0.8],
            "measured": True,
            "misfit": 0.1,
        }
    },
    "knees": {"left": {"thigh_deg": -14.8, "thigh_sd_deg": 15.0, "shank_deg": 3.0, "shank_sd_deg": 8.0}},
}


def test_a_place_clearly_elsewhere_is_told_beside_the_usual_one() -> None:
    view = view_sensor_places(STORED)
    assert view is not None
    foot, thigh = view.sensors
    assert foot.title == "Left foot"
    # outward is positive on the left, too
    assert foot.values == ("8.0 ± 0.7", "−0.5 ± 0.7", "2.0 ± 0.8")
    assert foot.off == "2.5 cm up, 2.0 cm outward"
    assert (thigh.measured, thigh.off, thigh.nominal) == (False, "", "6.0, −20.0, 6.0")
    (ankle,) = view.joints
    assert (ankle.title, ankle.off) == ("Left ankle, in the left shank", "")
    assert [(k.title, k.thigh, k.shank) for k in view.knees] == [("Left knee", "−15° ± 15°", "3° ± 8°")]


def test_without_arms_there_is_nothing_to_show() -> None:
    assert view_sensor_places(None) is None
