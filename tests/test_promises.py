"""The tests that docs/promises.md names are there."""

from __future__ import annotations

import re

from tests.data import ROOT


def test_every_promise_has_tests_and_every_test_is_there() -> None:
    lines = re.findall(r"^\| P\d+ \|.*$", (ROOT / "docs" / "promises.md").read_text("utf-8"), re.MULTILINE)
    named = [re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", line) for line in lines]
    assert len(named) > 8
    assert all(named)
    missing = [
        f"{path}::{name}"
        for tests in named
        for path, name in tests
        if not re.search(rf"^(async )?def {name}\(", (ROOT / path).read_text("utf-8"), re.MULTILINE)
    ]
    assert missing == []
