"""A pause in mid-stride is no zero of angles, a standing is: virtual people, real walks, the rule alone."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest

from sagittal.core.calibration import calibrate
from sagittal.core.calibration.standing import LEG_AHEAD, drop_pauses, measure_leg_ahead
from sagittal.core.errors import CalibrationError, SignalError
from sagittal.core.frames import Segment
from sagittal.core.pipeline import analyse
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.simulate import Stand, Straight, simulate_scenario
from tests.helpers.real_takes import NAMES, cut_recording, read_take
from tests.helpers.walks import TOGETHER, cut, only, scripted, simulated

RATE = 100.0
EDGE_S = 1.5
PATIENTS = (
    "healthy", "healthy_slow", "hemiparetic", "hemi_mild", "stiff_knee", "drop_foot", "crouch", "antalgic",
    "parkinson", "severe_shuffle", "step_asym", "elderly", "comfortable", "slow",
)  # fmt: skip
"""Virtual people who stand, walk, stop with one foot ahead, and walk on."""


def within_walk(name: str) -> UniformRecording:
    """The take from after its first step to before its last: all that is left of standing is the stop."""
    recording, truth = simulated(name)
    return cut(recording, truth.stands[0][1] + EDGE_S, truth.stands[-1][0] - EDGE_S)


def pause(steps: int, stands_s: float) -> UniformRecording:
    """A walk that stops after so many steps, without the standing before and after it."""
    step = Straight(0.62 * steps, 0.62, 0.55)
    recording, truth = scripted((Stand(4.0), step, Stand(stands_s), Straight(8.06, 0.62, 0.55), Stand(3.0)))
    return cut(recording, truth.stands[0][1] + 1.0, truth.stands[-1][0] - 1.0)


@pytest.mark.sweep
@pytest.mark.parametrize("name", PATIENTS)
def test_a_stop_of_a_virtual_person_is_no_standing(name: str) -> None:
    calibration = calibrate(within_walk(name)).calibration
    assert calibration.posture == "walking"
    (notices,) = (n.message for n in calibration.notices if n.code == "from_walking")
    assert "paused mid-stride" in notices


@pytest.mark.slow
@pytest.mark.parametrize("name", PATIENTS)
def test_the_standing_before_a_walk_is_taken(name: str) -> None:
    calibration = calibrate(simulated(name)[0]).calibration
    assert calibration.posture == "standing"
    assert calibration.zero[0] < 6.0


@pytest.mark.sweep
@pytest.mark.parametrize("stands_s", [1.9, 2.5, 4.0, 6.0])
@pytest.mark.parametrize("steps", [7, 8, 11, 12])
def test_a_stop_is_no_standing_wherever_it_is_and_however_long(steps: int, stands_s: float) -> None:
    assert calibrate(pause(steps, stands_s)).calibration.posture == "walking"


@pytest.mark.slow
@pytest.mark.parametrize(
    "worn", [("foot_l", "foot_r"), ("pelvis", "foot_l", "foot_r"), ("shank_l", "shank_r")]
)
def test_a_short_stop_is_no_standing_of_a_few_sensors(worn: tuple[Segment, ...]) -> None:
    assert calibrate(only(pause(11, 1.9), *worn)).calibration.posture == "walking"


@pytest.mark.slow
@pytest.mark.parametrize("steps", [8, 11])
def test_a_stop_with_both_feet_side_by_side_is_a_standing(steps: int) -> None:
    walk = Straight(0.62 * steps, 0.62, 0.55)
    recording, truth = scripted(
        (Stand(4.0), walk, *TOGETHER, Stand(4.0), Straight(8.06, 0.62, 0.55), Stand(3.0))
    )
    inside = cut(recording, truth.stands[0][1] + 1.0, truth.stands[-1][0] - 1.0)
    assert calibrate(inside).calibration.posture == "standing"


@pytest.mark.slow
def test_a_take_of_walking_with_a_pause_states_no_levels_and_no_step_length() -> None:
    analysis = analyse(cut_recording(simulate_scenario("healthy", seed=5).recording, 7.3, 29.4))
    assert analysis.problem is None
    assert "from_walking" in {n.code for n in analysis.notices}
    figures = {(p.name, p.side): p for p in analysis.parameters}
    for side in ("left", "right"):
        assert figures["step_length_m", side].mean is None
        assert figures["ankle_dorsiflexion_max_swing_deg", side].reason == "no_standing"
        assert figures["stride_length_m", side].mean == pytest.approx(1.28, abs=0.03)


@pytest.mark.sweep
@pytest.mark.parametrize("name", [n for n in NAMES if n != "14-1"])
def test_the_standing_of_a_real_walk_is_taken(name: str) -> None:
    """All but one of `ipol_walks`, in which nobody is still."""
    assert analyse(read_take(name)).calibration.posture == "standing"  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("rests", "walks", "kept"),
    [
        (((9.9, 11.1),), [(0.0, 9.8), (11.2, 22.1)], ()),
        (((9.9, 12.1),), [(0.0, 9.8), (12.2, 22.1)], ((9.9, 12.1),)),
        (((0.0, 1.2), (9.9, 11.1)), [(1.3, 9.8), (11.2, 22.1)], ((0.0, 1.2),)),
        (((20.0, 21.5),), [(2.0, 19.9)], ((20.0, 21.5),)),
        (((20.0, 21.5),), [(2.0, 19.9), (23.0, 25.0)], ((20.0, 21.5),)),
    ],
)
def test_a_short_rest_within_movement_is_a_pause(
    rests: tuple[tuple[float, float], ...],
    walks: list[tuple[float, float]],
    kept: tuple[tuple[float, float], ...],
) -> None:
    moving = np.zeros(4000, bool)
    for a, b in walks:
        moving[round(a * RATE) : round(b * RATE)] = True
    assert drop_pauses(rests, moving, RATE) == kept


@pytest.mark.parametrize(
    ("tilt_deg", "ahead_deg"),
    [
        ({"thigh_l": 15.0, "thigh_r": 11.4, "shank_l": -8.3, "shank_r": -12.1}, 3.6),
        ({"thigh_l": -7.2, "thigh_r": 12.1, "shank_l": -21.1, "shank_r": -3.6}, 17.5),
        ({"thigh_l": 30.0, "thigh_r": 5.0, "shank_l": -25.0, "shank_r": -10.0}, 0.0),
        ({"thigh_l": 25.0, "thigh_r": 10.0, "shank_l": -10.0, "shank_r": -10.0}, 0.0),
        ({"shank_l": -21.1, "shank_r": -3.6}, 8.75),
        ({"thigh_l": 20.0, "shank_l": -21.1, "foot_l": -10.0, "foot_r": -3.0}, 0.0),
        ({}, 0.0),
    ],
)
def test_one_leg_is_ahead_where_thigh_and_shank_say_so(
    tilt_deg: dict[Segment, float], ahead_deg: float
) -> None:
    leg_ahead = measure_leg_ahead({s: radians(x) for s, x in tilt_deg.items()})
    assert np.degrees(leg_ahead) == pytest.approx(ahead_deg, abs=1e-9)
    assert (leg_ahead >= LEG_AHEAD) == (ahead_deg > 6.0)


@pytest.mark.slow
def test_a_pause_and_hardly_a_walk_is_an_error_that_says_what_to_do() -> None:
    recording, truth = scripted(
        (Stand(4.0), Straight(2.5, 0.62, 0.55), Stand(1.9), Straight(2.5, 0.62, 0.55), Stand(3.0))
    )
    short = cut(recording, truth.stands[0][1] + 0.5, truth.stands[1][1] + 1.5)
    with pytest.raises((SignalError, CalibrationError)) as caught:
        calibrate(short)
    assert caught.value.code == "no_standing"
    assert "side by side" in caught.value.message
