"""From a script to a recording: the same arguments give the same bits, other seeds other sensors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.frames import GRAVITY
from sagittal.core.simulate.script import Stand, Straight
from sagittal.core.simulate.setup import RecordingSetup
from sagittal.core.simulate.simulation import Simulation, simulate
from sagittal.core.simulate.walker import Walker

SCRIPT = (Stand(1.0), Straight(1.8, 0.6, 0.5), Stand(1.0))


def made(seed: int = 1, setup: RecordingSetup | None = None) -> Simulation:
    return simulate(SCRIPT, seed=seed, setup=setup)


def test_the_same_arguments_give_the_same_bits_and_another_seed_does_not() -> None:
    one, second, alternative = made(), made(), made(2)
    for device, stream in one.recording.streams.items():
        same = second.recording.streams[device]
        assert np.array_equal(stream.acc, same.acc)
        assert stream.digest == same.digest
    assert set(one.recording.segments.values()) == set(alternative.recording.segments.values())
    assert len(one.recording.segments) == 7
    assert not set(one.recording.streams) & set(alternative.recording.streams)
    assert one.truth.seed == 1


def test_less_noise_leaves_the_steps_and_mountings_alone() -> None:
    noisy, clean = made(), made(setup=RecordingSetup(noise=None))
    for segment, q in noisy.truth.q.items():
        assert np.array_equal(q, clean.truth.q[segment])
        mount, same = noisy.truth.mounts[segment], clean.truth.mounts[segment]
        assert np.array_equal(mount.q_segment_sensor, same.q_segment_sensor)


def test_truth_and_recording_have_the_same_samples() -> None:
    result = made(setup=replace(RecordingSetup(), rate_hz=50.0))
    assert result.truth.rate_hz == 50.0
    (n,) = {len(s.t_s) for s in result.recording.streams.values()}
    assert n == len(result.truth.t_s)
    assert result.truth.t_s[1] == pytest.approx(0.02)
    assert result.recording.subject.height_m == Walker().height_m


def test_peaks_are_of_the_ideal_signals_and_feet_have_the_largest() -> None:
    result = made()
    peaks = result.peaks()
    for segment, (force, rate) in peaks.items():
        ideal = result.ideal[segment]
        assert force == np.linalg.norm(ideal.acc, axis=1).max() > GRAVITY
        assert rate == np.linalg.norm(ideal.gyr, axis=1).max()
    assert max(peaks, key=lambda s: peaks[s][1]).startswith("foot")
    assert peaks["pelvis"][1] == min(rate for _, rate in peaks.values())


def test_feet_that_land_with_a_shock_shake_more() -> None:
    assert made(setup=RecordingSetup(impacts=True)).peaks()["foot_l"][0] > made().peaks()["foot_l"][0]
