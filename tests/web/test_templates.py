"""Templates can be read: one element a line, none too long, and each is used."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import pytest

from tests.data import ROOT

TEMPLATES: Final = sorted((ROOT / "web" / "templates").glob("*.html"))
MOST_COLUMNS: Final = 120
MOST_LINES: Final = 250

INLINE: Final = "a|abbr|b|br|code|em|i|kbd|output|small|span|strong|svg|use|path"
"""Elements that may share a line: words and what stands among them."""
BLOCK: Final = re.compile(rf"<(?!(?:{INLINE})\b)[a-z][\w-]*")


@pytest.mark.parametrize("path", TEMPLATES, ids=lambda p: p.name)
def test_a_template_can_be_read(path: Path) -> None:
    lines = path.read_text().splitlines()
    assert len(lines) <= MOST_LINES, "long sections are files of their own: {% include %}"
    for number, line in enumerate(lines, 1):
        assert len(line) <= MOST_COLUMNS, f"line {number}"
        assert len(BLOCK.findall(line)) <= 2, f"line {number} has several elements: {line.strip()}"


def test_every_part_is_used() -> None:
    text = "\n".join(path.read_text() for path in TEMPLATES)
    unused = [p.name for p in TEMPLATES if p.name.startswith("_") and f'"{p.name}"' not in text]
    assert unused == []
