"""Steps of one trunk sensor: found on people who walk in many ways, refused where nothing walks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from sagittal.core.errors import SignalError
from sagittal.core.events import periodicity
from sagittal.core.events.lumbar import detect_steps
from sagittal.core.events.periodicity import step_times
from sagittal.core.events.steps import Steps
from sagittal.core.frames import GRAVITY, SIDES, Floats
from sagittal.core.rotation import normalise
from sagittal.core.signals.recording import SensorSignals, Subject, UniformRecording
from sagittal.core.simulate import SCRIPTS
from tests.helpers.event_scoring import match
from tests.helpers.marks import slow_after
from tests.helpers.walks import cut, lost, only, simulated, turned

WALKS = tuple(n for n in SCRIPTS if n not in ("five_minutes", "lost_sensor"))


def trunk(name: str) -> UniformRecording:
    return only(simulated(name)[0], "pelvis")


def times(steps: Steps) -> list[float]:
    return [s.time_s for s in steps.steps]


def contacts(name: str) -> list[float]:
    truth = simulated(name)[1]
    return sorted(t for side in SIDES for t in truth.contacts[side].contact.tolist())


def made(acc: Floats, gyr: Floats, rate_hz: float = 100.0) -> UniformRecording:
    """A recording of a pelvis sensor from its signals."""
    n = len(acc)
    ok = np.ones(n, np.bool_)
    signals = SensorSignals("made", acc, gyr, None, ok, ~ok)
    return UniformRecording(np.arange(n) / rate_hz, rate_hz, {"pelvis": signals}, Subject(), "walk", {})


def quicker(recording: UniformRecording, times: int) -> UniformRecording:
    """The same take at a multiple of its cadence: every n-th sample at the old rate."""
    x = recording.sensors["pelvis"]
    return made(x.acc[::times].copy(), x.gyr[::times].copy() * times, recording.rate_hz)


@pytest.mark.slow
@pytest.mark.parametrize("name", WALKS)
def test_every_walk_gives_its_steps_once(name: str) -> None:
    """Slow, fast, limping, shuffling, festinating: no step is doubled or halved, feet told are right."""
    found, truth = detect_steps(trunk(name)), simulated(name)[1]
    result = match(times(found), contacts(name), 0.35)
    # gait starts and stops with a step that hardly moves the trunk, each of two bouts has both
    assert result.missed <= 2
    assert len(result.extra) <= 3
    for step in found.steps:
        off = {s: float(np.abs(truth.contacts[s].contact - step.time_s).min()) for s in SIDES}
        if step.side is not None and min(off.values()) < 0.25:
            assert off[step.side] == min(off.values())
    steps = np.diff(contacts(name))
    assert found.cadence_spm == pytest.approx(60.0 / float(np.mean(steps[steps < 1.5])), rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", slow_after(4, WALKS))
def test_feet_are_told_on_nearly_all_walks(name: str) -> None:
    found = detect_steps(trunk(name))
    assert sum(s.side is not None for s in found.steps) >= 0.9 * len(found.steps)


def test_any_mounting_gives_the_same_steps() -> None:
    take = trunk("comfortable")
    q = normalise(np.array([0.3, -0.5, 0.7, 0.4]))
    assert times(detect_steps(turned(take, {"pelvis": q}))) == pytest.approx(
        times(detect_steps(take)), abs=1e-6
    )


def test_double_cadence_is_found() -> None:
    found = detect_steps(quicker(trunk("comfortable"), 2))
    assert found.cadence_spm == pytest.approx(2 * 110.6, rel=0.03)
    assert len(found.steps) == pytest.approx(72, abs=4)


def test_a_rhythm_too_quick_for_steps_is_refused_not_halved() -> None:
    found = detect_steps(quicker(trunk("comfortable"), 3))
    assert found.steps == ()
    assert [n.code for n in found.notices] == ["non_periodic"]


def test_standing_is_no_walking() -> None:
    found = detect_steps(cut(trunk("comfortable"), 0.0, 5.0))
    assert found.steps == ()
    assert [n.code for n in found.notices] == ["no_walking"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("width", [4.0, 8.0, 16.0])
def test_movement_without_a_rhythm_is_refused(seed: int, width: float) -> None:
    """Fidgeting: as strong as walking and as quick, but nothing repeats."""
    rng = np.random.default_rng(seed)
    noise = gaussian_filter1d(rng.standard_normal((6000, 6)), width, axis=0)
    noise /= noise.std(axis=0)
    found = detect_steps(made(np.array([0.0, 0.0, GRAVITY]) + 1.5 * noise[:, :3], 0.6 * noise[:, 3:]))
    assert found.steps == ()
    assert [n.code for n in found.notices] == ["non_periodic"]


def test_a_few_steps_are_no_bout() -> None:
    first = contacts("comfortable")[0]
    found = detect_steps(cut(trunk("comfortable"), first - 3.0, first + 2.0))
    assert found.steps == ()
    assert {n.code for n in found.notices} <= {"few_steps", "non_periodic"}


def test_no_step_is_found_while_the_sensor_was_lost() -> None:
    found = detect_steps(lost(trunk("comfortable"), "pelvis", 12.0, 16.0))
    assert not any(12.0 <= t < 16.0 for t in times(found))
    assert any(b.end_s < 12.1 for b in found.bouts)
    assert not any(b.start_s < 12.0 < 16.0 < b.end_s for b in found.bouts)


def test_a_stand_of_three_seconds_is_a_stop_or_an_end_and_rest_is_known() -> None:
    found = detect_steps(trunk("comfortable"))
    middle = simulated("comfortable")[1].stands[1]
    assert found.bouts[0].from_rest
    assert found.bouts[-1].to_rest
    ends = [b.end_s for b in found.bouts[:-1]] + [a for b in found.bouts for a, _ in b.stops]
    assert len(ends) == 1
    assert abs(ends[0] - middle[0]) < 1.0


def test_the_chest_tells_steps_but_no_feet() -> None:
    pelvis = trunk("comfortable")
    chest = replace(pelvis, sensors={"chest": pelvis.sensors["pelvis"]})
    found = detect_steps(chest)
    assert times(found) == times(detect_steps(pelvis))
    assert {s.side for s in found.steps} == {None}
    assert [n.code for n in found.notices] == ["side_unknown"]


def test_what_cannot_be_read_is_refused_with_its_code() -> None:
    with pytest.raises(SignalError) as missing:
        detect_steps(only(simulated("comfortable")[0], "foot_l"))
    assert missing.value.code == "no_trunk_sensor"
    with pytest.raises(SignalError) as slow:
        detect_steps(made(np.ones((100, 3)), np.zeros((100, 3)), 10.0))
    assert slow.value.code == "sample_rate_too_low"


@pytest.mark.parametrize("n", [1, 2, 50, 130])
def test_a_take_of_a_moment_does_no_harm(n: int) -> None:
    rng = np.random.default_rng(0)
    assert detect_steps(made(rng.standard_normal((n, 3)), rng.standard_normal((n, 3)))).steps == ()


def test_windows_that_are_looked_at_together_say_what_each_says(monkeypatch: pytest.MonkeyPatch) -> None:
    x = trunk("comfortable").sensors["pelvis"]
    together = step_times(x.acc[:, 1], x.gyr, 100.0)
    monkeypatch.setattr(periodicity, "TOGETHER", 1)
    alone = step_times(x.acc[:, 1], x.gyr, 100.0)
    np.testing.assert_array_equal(together.step_s, alone.step_s)
    np.testing.assert_array_equal(together.score, alone.score)


@pytest.mark.parametrize("step_s", [0.31, 0.6, 1.1])
def test_a_wave_repeats_with_its_step_time(step_s: float) -> None:
    t = np.arange(3000) / 100.0
    up, turn = np.sin(2.0 * np.pi * t / step_s), np.sin(np.pi * t / step_s)
    found = step_times(up, np.stack((turn, 0.0 * t, 0.5 * turn), axis=1), 100.0)
    assert found.t_s[0] == 2.0
    assert np.diff(found.t_s) == pytest.approx(1.0)
    np.testing.assert_allclose(found.step_s, step_s, atol=0.011)
    assert found.score.min() > 0.9
