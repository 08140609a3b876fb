"""docs/accuracy.md: every accuracy test writes its section, the others stay as they are."""

from __future__ import annotations

from collections.abc import Sequence

from tests.data import ROOT

PATH = ROOT / "docs" / "accuracy.md"
HEAD = """# Accuracy

Written by `tests/accuracy` on real recordings (see `tests/data.py` for where they are). Do not edit: run
`pytest tests/accuracy`. Each section names its limits; the tests fail beyond them."""


def record(section: str, header: Sequence[str], rows: Sequence[Sequence[str]], note: str = "") -> None:
    """Replace one section of docs/accuracy.md by a table and a note."""
    sections = _sections()
    lines = [_line(header), _line(["---"] * len(header)), *(_line(row) for row in rows)]
    sections[section] = "\n".join(lines) + (f"\n\n{note}" if note else "")
    text = "\n\n".join([HEAD, *(f"## {name}\n\n{sections[name]}" for name in sorted(sections))]) + "\n"
    if not PATH.exists() or PATH.read_text(encoding="utf-8") != text:
        PATH.write_text(text, encoding="utf-8")


def _sections() -> dict[str, str]:
    """Sections as they stand, title → body."""
    if not PATH.exists():
        return {}
    parts = PATH.read_text(encoding="utf-8").split("\n## ")[1:]
    return {title.strip(): body.strip() for title, _, body in (part.partition("\n") for part in parts)}


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"
