from __future__ import annotations

import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.frames import SIDES
from sagittal.core.simulate import simulate_scenario

SHORT = ["comfortable", "slow", "fast_with_turns", "figure_of_eight", "lost_sensor"]


@pytest.mark.sweep
@pytest.mark.parametrize("name", SHORT)
def test_named_scripts_are_long_enough_for_an_analysis(name: str) -> None:
    simulation = simulate_scenario(name, seed=2)
    truth = simulation.truth
    assert 40.0 <= truth.t_s[-1] <= 65.0
    assert truth.stands[0][1] - truth.stands[0][0] >= 5.0
    assert truth.stands[-1][1] - truth.stands[-1][0] >= 3.0
    for side in SIDES:
        assert sum(s.side == side for s in truth.strides) >= 20
    assert truth.guard_m < 0.03
    assert max(share.mean() for share in simulation.clipped.values()) < 0.002


@pytest.mark.slow
def test_the_lost_sensor_is_lost_and_comes_back() -> None:
    simulation = simulate_scenario("lost_sensor", seed=2)
    device = next(d for d, s in simulation.recording.segments.items() if s == "shank_r")
    t = simulation.recording.streams[device].t_s
    assert not ((t >= 18.0) & (t < 28.0)).any()
    assert t[-1] == pytest.approx(simulation.truth.t_s[-1], abs=0.5)


@pytest.mark.sweep
def test_five_minutes_last_five_minutes() -> None:
    assert simulate_scenario("five_minutes", seed=1).truth.t_s[-1] == pytest.approx(300.0, abs=10.0)


@pytest.mark.slow
def test_height_reaches_the_recording_and_the_lengths() -> None:
    simulation = simulate_scenario("slow", seed=2, height_m=1.60)
    assert simulation.recording.subject.height_m == 1.60
    lengths = [s.length_m for s in simulation.truth.strides if s.side == "left"][2:10]
    assert sum(lengths) / len(lengths) == pytest.approx(0.96 * 1.60 / 1.745, rel=0.03)


def test_an_unknown_script_lists_the_known_ones() -> None:
    with pytest.raises(ParameterError, match="comfortable") as caught:
        simulate_scenario("marathon")
    assert caught.value.code == "unknown_script"
