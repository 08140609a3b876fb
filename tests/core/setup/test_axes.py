"""Gravity carried along by the gyroscope: correct axes fit, others are detected, undecided cases."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.rotation import about, conjugate, log, multiply, rotate
from sagittal.core.setup.axes import CHOICES, REVERSED, fit_axes, refuses_choice
from sagittal.core.setup.params import SetupParams
from sagittal.core.signals.recording import SensorSignals

RATE, PARAMS = 100.0, SetupParams()


@cache
def moved(shaking_m: float = 0.004) -> SensorSignals:
    """A sensor that rests for 3 s, turns to and fro about all axes for 9 s and rests again."""
    t = np.arange(1501) / RATE
    fade = np.clip((t - 3.0) / 0.3, 0.0, 1.0) * np.clip((12.0 - t) / 0.3, 0.0, 1.0)
    a, b, c = (fade * np.sin(2.0 * np.pi * f * (t - 3.0)) for f in (0.7, 0.9, 1.1))
    q = multiply(multiply(about(0, 0.8 * a + 0.4), about(1, 0.9 * b - 0.7)), about(2, 0.7 * c + 0.2))
    rng = np.random.default_rng(0)
    gyr = RATE * log(multiply(conjugate(q[:-1]), q[1:])) + rng.normal(0.0, 0.003, (1500, 3))
    shake = shaking_m * (2.0 * np.pi * 2.0) ** 2 * fade * np.sin(4.0 * np.pi * t)
    force = np.stack((shake, -shake, GRAVITY + shake), axis=1)
    acc = rotate(conjugate(q[1:]), force[1:]) + rng.normal(0.0, 0.02, (1500, 3))
    mask = np.ones(1500, np.bool_)
    return SensorSignals("a", acc, gyr, None, mask, ~mask)


def with_gyroscope(times: Floats, source: SensorSignals | None = None) -> SensorSignals:
    """The same sensor whose gyroscope has to be multiplied by this."""
    source = source or moved()
    return source.change(gyr=source.gyr @ np.linalg.inv(times).T)


def test_every_way_to_name_and_sign_three_axes_is_tried_once_and_the_stated_one_first() -> None:
    assert np.array_equal(CHOICES[0], np.eye(3))
    assert np.array_equal(CHOICES[REVERSED], -np.eye(3))
    assert len(np.unique(CHOICES.reshape(50, 9), axis=0)) == 50
    assert all(np.array_equal(m @ m.T, np.eye(3)) for m in CHOICES[:48])
    assert CHOICES[48] == pytest.approx(np.radians(1.0) * np.eye(3))
    assert CHOICES[49] == pytest.approx(np.degrees(1.0) * np.eye(3))


def test_a_right_gyroscope_is_not_compared_with_others() -> None:
    fit = fit_axes(moved(), RATE, PARAMS)
    assert fit is not None
    # three averages of each rest
    assert fit.windows == 6
    assert fit.stated < PARAMS.misfit_mps2
    assert fit.misfits is None


@pytest.mark.parametrize("choice", [REVERSED, 21])
def test_what_the_rates_have_to_be_multiplied_by_fits_best_and_alone(choice: int) -> None:
    fit = fit_axes(with_gyroscope(CHOICES[choice]), RATE, PARAMS)
    assert fit is not None
    assert fit.misfits is not None
    assert fit.misfits[0] == fit.stated > 1.0
    assert int(np.argmin(fit.misfits)) == choice
    right = fit_axes(moved(), RATE, PARAMS)
    assert right is not None
    assert fit.misfits[choice] == pytest.approx(right.stated, rel=1e-6)
    assert np.sort(fit.misfits)[1] > PARAMS.distinct * fit.misfits[choice]


def test_axes_that_none_of_the_choices_puts_right_are_told_without_a_choice() -> None:
    fit = fit_axes(with_gyroscope(1.1 * np.eye(3)), RATE, PARAMS)
    assert fit is not None
    assert fit.stated > PARAMS.misfit_mps2
    assert fit.misfits is None


def test_a_right_sensor_refuses_what_a_wrong_one_needs() -> None:
    assert refuses_choice(moved(), RATE, CHOICES[REVERSED], PARAMS)
    assert not refuses_choice(moved(), RATE, CHOICES[0], PARAMS)
    assert not refuses_choice(with_gyroscope(CHOICES[REVERSED]), RATE, CHOICES[REVERSED], PARAMS)


def test_a_sensor_that_fits_nothing_well_refuses_nothing_that_is_hardly_worse() -> None:
    wrong = with_gyroscope(CHOICES[REVERSED])
    fit = fit_axes(wrong, RATE, PARAMS)
    assert fit is not None
    assert fit.misfits is not None
    like = int(np.argsort(np.abs(fit.misfits - fit.stated))[1])
    assert PARAMS.misfit_mps2 < fit.misfits[like] < PARAMS.distinct * fit.stated
    assert not refuses_choice(wrong, RATE, CHOICES[like], PARAMS)


def test_too_few_averages_say_nothing() -> None:
    seven = replace(PARAMS, least_windows=7)
    assert fit_axes(moved(), RATE, seven) is None
    assert not refuses_choice(moved(), RATE, CHOICES[REVERSED], seven)
    # a lost sample takes the averages that would be carried over it
    mask = np.ones(len(moved().acc), np.bool_)
    mask[500] = False
    fit = fit_axes(moved().change(valid=mask), RATE, PARAMS)
    assert fit is not None
    assert fit.windows == 3


def test_a_sensor_that_hardly_turns_or_shakes_says_nothing() -> None:
    still = moved().change(gyr=np.zeros_like(moved().gyr), acc=np.tile(moved().acc[0], (len(moved().acc), 1)))
    assert fit_axes(still, RATE, PARAMS) is None
    # who shakes is moving, whatever the gyroscope says of it
    fit = fit_axes(with_gyroscope(CHOICES[49], moved(shaking_m=0.03)), RATE, PARAMS)
    assert fit is not None
    assert fit.misfits is not None
    assert int(np.argmin(fit.misfits)) == 49
