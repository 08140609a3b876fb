"""Marks for the cases of a test."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest


def slow_beyond(usual: int, cases: Sequence[Any]) -> list[Any]:
    """Cases of a test of which only the first few run in every run; the others are slow."""
    slow = [
        pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.slow)
        for case in cases[usual:]
    ]
    return [*cases[:usual], *slow]
