"""Plain facts of one sensor: stillness, plateaus, the magnetic field, each measured once."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from sagittal.core.frames import GRAVITY
from sagittal.core.quality.signals import magnetic_share, measure_signal, measure_stream, saturation
from tests.core.formats.making import signals, stream
from tests.data import ROOT

ACC, GYR = signals(2000, still=500)


def test_a_trunk_that_turns_slowly_is_no_rest_with_the_wrong_unit() -> None:
    """Its force is calm for a second in which it turns by 15 °/s: seen in a walk without standing."""
    t = np.arange(1000) / 100.0
    acc = np.array([0.0, 9.81, 0.0]) + 0.05 * np.sin(2 * np.pi * 1.8 * t)[:, None]
    gyr = np.zeros((1000, 3))
    gyr[:, 1] = 0.4 + 0.3 * np.sin(2 * np.pi * 0.9 * t)
    assert measure_signal(acc, gyr, 100.0).still_gyro is None
    rng = np.random.default_rng(0)
    biased = np.full((1000, 3), 0.3) + 0.05 * rng.standard_normal((1000, 3))
    assert measure_signal(acc, biased, 100.0).still_gyro == pytest.approx(0.53, abs=0.05)


def test_clipping_is_a_plateau_not_a_peak() -> None:
    rng = np.random.default_rng(1)
    x = rng.normal(0, 60, (5000, 3))
    assert saturation(x, 18.0) == (0.0, None)
    slow = np.stack([200 * np.sin(np.arange(5000) / 50)] * 3, axis=1)
    share, top = saturation(np.clip(slow, -156.9, 156.9), 18.0)
    assert top == pytest.approx(156.9)
    assert share == pytest.approx(np.mean(np.abs(slow[:, 0]) >= 156.9), abs=0.01)
    assert saturation(np.clip(slow, -10, 10), 18.0) == (0.0, None)


def test_the_magnetic_share_counts_from_the_norm_at_rest() -> None:
    mag = np.tile([0.3, 0.4, 0.0], (1000, 1))
    mag[600:800] *= 1.2
    mag[900:950] = np.nan
    assert magnetic_share(mag, slice(0, 100), 0.1) == pytest.approx(200 / 950)
    assert magnetic_share(mag, slice(900, 950), 0.1) is None


def test_facts_survive_short_and_holed_signals() -> None:
    acc = np.full((5, 3), np.nan)
    acc[2] = [0.0, 0.0, 9.81]
    f = measure_signal(acc, None, 100.0)
    assert f.still_norm == pytest.approx(9.81)
    assert f.gyro_top is None


def test_turning_on_the_spot_while_the_trunk_is_level_is_no_wrong_unit() -> None:
    """mobgap_lowback Test5: the quietest second of the accelerometer is within a turn."""
    still = np.tile([0.0, 0.0, GRAVITY], (1000, 1))
    acc = still + np.random.default_rng(0).normal(0.0, 0.05, still.shape)
    acc[400:600] = still[400:600]
    gyr = np.full(still.shape, 0.02)
    gyr[400:600, 2] = 0.8
    assert measure_signal(acc, gyr, 100.0).still_gyro == pytest.approx(0.02 * 3**0.5)
    everywhere = np.full(still.shape, 1.0)
    assert measure_signal(acc, everywhere, 100.0).still_gyro == pytest.approx(3**0.5)


def test_infinite_samples_are_no_plateau() -> None:
    acc = ACC.copy()
    acc[100:110] = np.inf
    assert saturation(acc, 10.0) == (0.0, None)


@pytest.mark.slow
def test_a_table_is_judged_without_a_compiler() -> None:
    """The web process does: numba would cost it seconds and memory."""
    code = "import sys, numpy as np; from sagittal.core.quality.signals import measure_signal; "
    code += "measure_signal(np.ones((200, 3)), np.zeros((200, 3)), 100.0); sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0


def test_a_stream_is_measured_once() -> None:
    one = stream("a", ACC, GYR)
    facts = measure_stream(one)
    assert facts == measure_signal(one.acc, one.gyr, one.rate_hz)
    assert measure_stream(one) is facts
    assert measure_stream(stream("a", 2.0 * ACC, GYR)) != facts
