"""`sagittal warm`: after it the first analysis finds its filters."""

from __future__ import annotations

import pytest

from server.main import main
from server.storage.compile_cache import has_compiled_filters

pytestmark = pytest.mark.slow


def test_warm_goes_through_every_step_and_leaves_filters(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["warm"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line[:6] for line in lines[1:]] == ["1 of 2", "2 of 2"]
    assert has_compiled_filters()
