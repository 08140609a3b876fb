"""Every promise of docs/reference/promises.md names tests that exist."""

from __future__ import annotations

import re

from tests.data import ROOT

FEWEST = 9
"""Promises on the page; fewer means that its table was not read."""


def find_untested_promises() -> list[str]:
    """Promises without a test, and tests they name that do not exist."""
    lines = re.findall(
        r"^\| P\d+ \|.*$", (ROOT / "docs" / "reference" / "promises.md").read_text("utf-8"), re.MULTILINE
    )
    named = [re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", line) for line in lines]
    if len(lines) < FEWEST:
        return [f"docs/reference/promises.md: {len(lines)} promises found, expected {FEWEST} or more"]
    return [line for line, tests in zip(lines, named, strict=True) if not tests] + [
        f"{path}::{name}"
        for tests in named
        for path, name in tests
        if not re.search(rf"^(async )?def {name}\(", (ROOT / path).read_text("utf-8"), re.MULTILINE)
    ]
