"""Drafts of a take on common clocks."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.errors import FormatError
from sagittal.core.formats.common_time import finish
from sagittal.core.formats.draft import Draft, make_draft
from sagittal.core.frames import Floats
from tests.core.formats.making import signals

ACC, GYR = signals(1000)


def draft(t: Floats, rate_hz: float | None = None) -> Draft:
    return make_draft("a", "a.csv", "device", t, acc=ACC[: len(t)], gyr=GYR[: len(t)], rate_hz=rate_hz)


def test_a_declared_rate_that_the_time_column_contradicts_is_said_and_not_used() -> None:
    stream = finish([draft(np.arange(1000) / 128.0, rate_hz=100.0)])["a"]
    assert stream.rate_hz == pytest.approx(128.0)
    assert [n.code for n in stream.notices] == ["rate_contradicted"]
    assert not finish([draft(np.arange(1000) / 100.3, rate_hz=100.0)])["a"].notices


def test_rounded_stamps_have_the_rate_of_their_mean() -> None:
    stream = finish([draft(np.round(np.arange(1000) / 128.0, 3))])["a"]
    assert stream.rate_hz == pytest.approx(128.0, rel=1e-3)


def test_equal_stamps_are_refused_unless_a_rate_is_declared() -> None:
    with pytest.raises(FormatError) as e:
        finish([draft(np.full(1000, 1.7e9))])
    assert e.value.code == "time_constant"
    stream = finish([draft(np.full(1000, 1.7e9), rate_hz=100.0)])["a"]
    np.testing.assert_allclose(stream.t_s, np.arange(1000) / 100.0)
    assert [n.code for n in stream.notices] == ["time_constant"]
