"""Marks and parameter sets shared by tests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

sqlite_only = pytest.mark.skipif(
    "config.getoption('--engine') == 'postgresql'", reason="concerns the SQLite file"
)


def slow_after(count: int, cases: Sequence[Any]) -> list[Any]:
    """Parameters of a test of which all after the first `count` are marked slow."""
    return _mark_after(count, cases, pytest.mark.slow)


def sweep_after(count: int, cases: Sequence[Any]) -> list[Any]:
    """Parameters of a test of which all after the first `count` are left to the validation."""
    return _mark_after(count, cases, pytest.mark.sweep)


def _mark_after(count: int, cases: Sequence[Any], mark: pytest.MarkDecorator) -> list[Any]:
    marked = [
        pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=mark) for case in cases[count:]
    ]
    return [*cases[:count], *marked]
