"""What no person can do, at its limits."""

from __future__ import annotations

from math import degrees, inf, nan, nextafter

import pytest

from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.core.parameters.plausible import LEAST_KNEE, is_impossible


@pytest.mark.parametrize(
    ("name", "value", "impossible"),
    [
        ("cadence_spm", 240.0, False),
        ("cadence_spm", nextafter(240.0, inf), True),
        ("cadence_spm", 0.0, False),
        ("cadence_spm", -0.1, True),
        ("step_time_s", 0.2, False),
        ("step_time_s", nextafter(0.2, 0.0), True),
        ("step_time_s", 1e9, False),
        ("step_time_s", nan, False),
        # without limits of its own anything goes, and so does what the catalogue does not know
        ("knee_flexion_rom_deg", -1e9, False),
        ("stride_colour_nm", -1e9, False),
    ],
)
def test_a_limit_itself_can_still_be_reached(name: str, value: float, impossible: bool) -> None:
    assert is_impossible(name, value) is impossible


def test_a_knee_may_bend_backwards_a_little() -> None:
    assert degrees(LEAST_KNEE) == pytest.approx(-20.0)


def test_nobody_is_refused_whom_the_bars_can_show() -> None:
    for name, entry in CATALOGUE.items():
        assert not any(is_impossible(name, end) for end in entry.scale), name
