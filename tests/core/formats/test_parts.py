"""Sensors from several files."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.errors import FormatError
from sagittal.core.formats.draft import Draft
from sagittal.core.formats.parts import join_parts
from sagittal.core.signals.held_samples import is_complete


def draft(part: str | None, rate: float, n: int, start: float = 0.0, device: str = "a") -> Draft:
    t = start + np.arange(n) / rate
    values = np.stack([np.sin(t), np.cos(t), t], axis=1)
    return Draft(device, f"{part}.csv", "device", t, values, None, None, None, rate, (), part=part)


def test_a_gyroscope_on_a_clock_of_its_own_is_laid_on_that_of_the_acceleration() -> None:
    (joined,) = join_parts([draft(None, 100.0, 1000), draft("gyr", 104.0, 900, 0.103)])
    assert joined.gyr is not None
    t = joined.ticks
    known = is_complete(joined.gyr)
    np.testing.assert_allclose(joined.gyr[known, 0], np.sin(t[known]), atol=5e-3)
    assert not known[t < 0.09].any()
    assert not known[t > 8.8].any()


def test_acceleration_without_gravity_needs_the_file_of_gravity() -> None:
    linear, gyr = draft("linear", 100.0, 500), draft("gyr", 100.0, 500)
    with pytest.raises(FormatError, match="TotalAcceleration") as e:
        join_parts([linear, gyr])
    assert e.value.code == "gravity_removed"
    (joined,) = join_parts([linear, draft("gravity", 100.0, 500), gyr])
    np.testing.assert_allclose(joined.acc, 2 * linear.acc)


def test_a_gyroscope_alone_is_refused() -> None:
    with pytest.raises(FormatError) as e:
        join_parts([draft("gyr", 100.0, 500)])
    assert e.value.code == "missing_acc"
