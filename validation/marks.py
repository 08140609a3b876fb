"""How much of the validation runs: all cases, or a sample of the expensive ones."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Final, TypeVar

import pytest

T = TypeVar("T")

WHOLE: Final = os.environ.get("SAGITTAL_VALIDATION") == "whole"
"""Whether every case runs; set by `python -m validation`."""

whole_only = pytest.mark.skipif(not WHOLE, reason="takes minutes: run `python -m validation`")


def sample(cases: Sequence[T], one_in: int, first: int = 0) -> list[T]:
    """Every `one_in`-th case, starting with `first`; all of them in a whole validation."""
    return list(cases if WHOLE else cases[first % min(one_in, len(cases)) :: one_in])
