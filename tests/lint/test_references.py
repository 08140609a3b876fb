"""The reference rules detect planted violations."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import pytest

from tests.lint.references import mentions, missing

ABOVE: Final = ".."
HOME: Final = "/" + "home"
"""Put together here, so that this file itself mentions nothing outside."""

GOOD: Final = {
    "core/a.py": '"""docs/page.md, "One" and\n# "Two `b`"; docs/page.md, *One*, "Two `b`"."""\n',
    "docs/page.md": "# Page\n\n## One\n\n[here](#one) [a](../core/a.py) [out](https://a.org/x)\n\n"
    "## Two `b`\n\n```\n## no heading\n```\n\n`core/a.py`, docs/page.md#two-b\n",
    "README.md": '[page](docs/page.md#one), "One"\n',
}


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A repository without a fault."""
    for name, text in GOOD.items():
        plant(tmp_path, name, text)
    assert missing(tmp_path) == []
    assert mentions(tmp_path) == []
    return tmp_path


def plant(root: Path, name: str, text: str) -> None:
    """Append to a file."""
    path = root / name
    path.parent.mkdir(exist_ok=True)
    path.write_text((path.read_text("utf-8") if path.exists() else "") + text, encoding="utf-8")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("core/a.py", "# docs/gone.md"),
        ("core/a.py", "# docs/science/page.md"),
        ("core/a.py", '# docs/page.md, "Three"'),
        ("core/a.py", '# docs/page.md, "One" and\n# "Three"'),
        ("core/a.py", '# docs/page.md,\n# "no heading"'),
        ("core/a.py", 'A = "docs/page.md, "\n    "*Thr"\n    "ee*"'),
        ("web/a.js", "// docs/page.md#three"),
        ("docs/page.md", "[a](gone.md)"),
        ("docs/page.md", "[a](#three)"),
        ("docs/page.md", "![a](gone.png)"),
        ("docs/page.md", f"[a]({ABOVE}/{ABOVE}/outside.md)"),
        ("docs/page.md", "[a](page.md), *Three*"),
        ("docs/page.md", "[a](page.md): *One*, *Three*"),
        ("docs/page.md", "`core/gone.py`"),
        ("core/a.py", "# core/gone.py"),
        ("README.md", "[a](docs/page.md#three)"),
    ],
)
def test_a_planted_reference_that_leads_nowhere_is_found(small: Path, name: str, text: str) -> None:
    plant(small, name, text)
    assert len(missing(small)) == 1


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("core/a.py", "# spec/fusion.md"),
        ("core/a.py", "# see design/look/"),
        ("core/a.py", "# (clinic.md, 4)"),
        ("core/a.py", "# spec §3"),
        ("docs/page.md", "DESIGN.md"),
        ("docs/page.md", f"in {ABOVE}/shared"),
        ("tests/a.py", f"A = '{HOME}/anna/sagittal'"),
    ],
)
def test_a_planted_mention_of_what_is_outside_is_found(small: Path, name: str, text: str) -> None:
    plant(small, name, text)
    assert len(mentions(small)) == 1
