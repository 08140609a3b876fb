"""Ages that leave the clinic."""

from __future__ import annotations

import pytest

from sagittal.server.export.ages import coarsen_age


@pytest.mark.parametrize(("age", "told"), [(None, None), (0, 0), (88, 88), (89, 89), (90, 89), (104, 89)])
def test_who_is_older_than_89_is_told_as_89(age: int | None, told: int | None) -> None:
    assert coarsen_age(age) == told
