"""Curves as the API gives them."""

from __future__ import annotations

import numpy as np

from sagittal.server.report.view.model_json import round_curve


def test_a_curve_is_rounded_and_what_is_undefined_is_null() -> None:
    assert round_curve(np.array([1.234, np.nan, -0.006])) == [1.23, None, -0.01]
    assert round_curve(None) is None
