"""What benches share."""

import gc
from collections.abc import Iterator

import pytest

from tests.helpers.engines import source  # noqa: F401 - a fixture


@pytest.fixture(autouse=True)
def what_others_left() -> Iterator[None]:
    """Objects of earlier tests are not walked through by the collector while one is measured."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()
