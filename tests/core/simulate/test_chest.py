from __future__ import annotations

import itertools

import numpy as np
import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.rotation import rotate
from sagittal.core.simulate import ChestSimulation, PostureHold, RecordingSetup, simulate_day
from sagittal.core.simulate.walker import REFERENCE_HEIGHT_M

EXACT = RecordingSetup(noise=None, mount_spread_rad=0.0)

DAY = (
    PostureHold("sit", 5.0),
    PostureHold("stand", 3.0),
    PostureHold("walk", 8.0, 110.0),
    PostureHold("stand", 2.0),
    PostureHold("sit", 4.0),
    PostureHold("lie", 6.0),
    PostureHold("sit", 3.0),
    PostureHold("stand", 3.0),
)
"""The take of docs/science/simulation.md, "Chest"."""


@pytest.fixture(scope="module")
def day() -> ChestSimulation:
    return simulate_day(DAY, REFERENCE_HEIGHT_M, setup=EXACT)


def test_the_day_has_the_figures_of_the_specification(day: ChestSimulation) -> None:
    truth = day.truth
    assert truth.t_s[-1] == pytest.approx(44.5)
    assert sum("_to_" in p.kind for p in truth.phases) == 5
    force = np.linalg.norm(day.ideal["chest"].acc, axis=1)
    assert force.min() == pytest.approx(7.1, abs=0.1)
    assert force.max() == pytest.approx(12.5, abs=0.1)
    assert np.degrees(truth.pitch_rad.min()) == pytest.approx(-88.0, abs=0.1)
    assert np.degrees(truth.pitch_rad.max()) == pytest.approx(40.0, abs=1.0)


def test_rising_from_a_chair_lifts_the_chest_by_its_height(day: ChestSimulation) -> None:
    truth = day.truth
    for phase in (p for p in truth.phases if p.kind == "sit_to_stand"):
        initial, final = np.interp((phase.start_s, phase.end_s), truth.t_s, truth.height_m)
        assert final - initial == pytest.approx(0.40, abs=1e-9)


def test_the_trunk_leans_before_the_body_rises(day: ChestSimulation) -> None:
    truth = day.truth
    rise = next(p for p in truth.phases if p.kind == "sit_to_stand")
    inside = (truth.t_s >= rise.start_s) & (truth.t_s <= rise.end_s)
    t, pitch, height = truth.t_s[inside], truth.pitch_rad[inside], truth.height_m[inside]
    lifted = t[np.searchsorted(height, height[0] + 0.01)]
    assert np.interp(lifted, t, pitch) - pitch[0] > np.radians(10.0)
    assert t[np.argmax(pitch)] < t[np.searchsorted(height, 0.5 * (height[0] + height[-1]))] + 0.1


def test_the_sensor_reads_gravity_along_the_trunk_in_every_posture(day: ChestSimulation) -> None:
    truth, acc = day.truth, day.ideal["chest"].acc
    for phase in (p for p in truth.phases if p.kind in ("stand", "sit", "lie")):
        inside = (truth.t_s > phase.start_s + 0.1) & (truth.t_s < phase.end_s - 0.1)
        # forward lean brings gravity to the back of the sensor's forward axis: x reads −g sin(pitch)
        pitch = np.arctan2(-acc[inside, 0], acc[inside, 1])
        assert pitch == pytest.approx(truth.pitch_rad[inside], abs=1e-6)


def test_signals_are_derivatives_of_the_way() -> None:
    fine = simulate_day(
        DAY, REFERENCE_HEIGHT_M, setup=RecordingSetup(noise=None, mount_spread_rad=0.0, rate_hz=400.0)
    )
    truth, dt = fine.truth, 1.0 / fine.truth.rate_hz
    rate = -np.gradient(truth.pitch_rad, dt)
    assert fine.ideal["chest"].gyr[2:-2, 2] == pytest.approx(rate[2:-2], abs=0.02)
    assert np.abs(fine.ideal["chest"].gyr[:, :2]).max() < 1e-9, "it stays in its plane"


def test_walking_has_its_steps(day: ChestSimulation) -> None:
    truth = day.truth
    walk = next(p for p in truth.phases if p.kind == "walk")
    assert len(truth.steps_s) == 14
    assert np.diff(truth.steps_s) == pytest.approx(60.0 / 110.0)
    middle = truth.steps_s[(truth.steps_s > walk.start_s + 1.0) & (truth.steps_s < walk.end_s - 1.0)]
    assert np.interp(middle, truth.t_s, truth.height_m) == pytest.approx(1.32, abs=2e-3)
    went = np.interp((walk.start_s, walk.end_s), truth.t_s, truth.forward_m)
    assert went[1] - went[0] == pytest.approx(1.1 * (8.0 - 0.8), rel=0.02)


def test_phases_cover_the_take_without_gaps(day: ChestSimulation) -> None:
    phases = day.truth.phases
    assert phases[0].start_s == 0.0
    assert phases[-1].end_s == pytest.approx(day.truth.t_s[-1])
    for initial, final in itertools.pairwise(phases):
        assert initial.end_s == final.start_s


def test_one_sits_down_from_walking_like_from_standing() -> None:
    kinds = [
        p.kind
        for p in simulate_day(
            (PostureHold("walk", 4.0), PostureHold("sit", 2.0), PostureHold("lie", 2.0))
        ).truth.phases
    ]
    assert kinds == ["walk", "stand_to_sit", "sit", "sit_to_lie", "lie"]


def test_its_recording_is_one_sensor_on_the_chest_turned_as_mounted() -> None:
    simulation = simulate_day(DAY, seed=6, setup=RecordingSetup(noise=None))
    assert simulation.recording.protocol == "activity"
    assert set(simulation.recording.segments.values()) == {"chest"}
    plain = simulate_day(DAY, seed=6, setup=EXACT)
    turned = rotate(simulation.truth.mount.q_segment_sensor, simulation.ideal["chest"].gyr)
    assert turned == pytest.approx(plain.ideal["chest"].gyr, abs=1e-6)


@pytest.mark.parametrize(
    "day",
    [
        (),
        (PostureHold("sit", 0.0),),
        (PostureHold("walk", 1.0),),
        (PostureHold("walk", 9.0, 5.0),),
        (PostureHold("kneel", 3.0),),  # type: ignore[arg-type]
        (PostureHold("stand", float("nan")),),
    ],
)
def test_an_impossible_day_is_refused(day: tuple[PostureHold, ...]) -> None:
    with pytest.raises(ParameterError) as caught:
        simulate_day(day)
    assert caught.value.code == "day_item"
