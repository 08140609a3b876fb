"""One thing, or any other number of them."""

from __future__ import annotations

import pytest

from sagittal.core.plurals import plural


@pytest.mark.parametrize(
    ("count", "noun"), [(0, "rows"), (1, "row"), (2, "rows"), (11, "rows"), (-1, "rows")]
)
def test_only_a_single_one_is_singular(count: int, noun: str) -> None:
    assert plural(count, "row", "rows") == noun
