"""What benches share."""

from tests.engines import source  # noqa: F401 - a fixture
