"""Named movements are simulated as such; unknown names are refused with a list."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.simulate.chest import ChestSimulation
from sagittal.core.simulate.movements import MOVEMENTS, ChairTest, simulate_movement
from sagittal.core.simulate.patients import PATIENTS
from sagittal.core.simulate.squat import Squats, SquatSimulation
from sagittal.core.simulate.squat_chain import place_as_agreed
from sagittal.core.simulate.tug import ChairSimulation


def test_a_name_that_is_none_is_refused_with_those_that_are() -> None:
    with pytest.raises(ParameterError) as caught:
        simulate_movement("dance")
    assert caught.value.code == "unknown_script"
    assert all(name in caught.value.message for name in MOVEMENTS)


def test_every_patient_has_a_timed_up_and_go() -> None:
    assert {n.removeprefix("tug_") for n in MOVEMENTS if n.startswith("tug_")} == set(PATIENTS)
    for name, patient in PATIENTS.items():
        movement = MOVEMENTS[f"tug_{name}"]
        assert movement.does == ChairTest(name)
        assert movement.title.endswith(patient.title)


def test_titles_say_how_the_sensors_of_squats_sit() -> None:
    for movement in MOVEMENTS.values():
        if isinstance(movement.does, Squats):
            assert ("put on as agreed" in movement.title) is movement.agreed
            assert ("put on anyhow" in movement.title) is not movement.agreed
        else:
            assert not movement.agreed


@pytest.mark.parametrize(("name", "agreed"), [("squats_agreed", True), ("squats", False)])
def test_only_sensors_put_on_as_agreed_sit_where_the_analysis_takes_them(name: str, agreed: bool) -> None:
    simulation = simulate_movement(name, 1, 1.7)
    assert isinstance(simulation, SquatSimulation)
    for segment, place in place_as_agreed(1.7, ("right",)).items():
        mount = simulation.truth.mounts[segment]
        turned = abs(float(mount.q_segment_sensor @ place.q_segment_sensor))
        assert (turned > 1.0 - 1e-9 and np.array_equal(mount.position_m, place.position_m)) is agreed


def test_rises_of_the_day_are_of_a_chest_and_at_the_asked_rate() -> None:
    simulation = simulate_movement("chair_rises", 1, rate_hz=50.0)
    assert isinstance(simulation, ChestSimulation)
    assert {s.rate_hz for s in simulation.recording.streams.values()} == {50.0}
    assert sum(h.posture == "sit" for h in MOVEMENTS["chair_rises"].does) == 6  # type: ignore[union-attr]


def test_five_rises_are_not_a_walk_there_and_back() -> None:
    simulation = simulate_movement("five_sit_to_stand", 1, rate_hz=50.0)
    assert isinstance(simulation, ChairSimulation)
    assert simulation.recording.protocol == "five_sit_to_stand"
