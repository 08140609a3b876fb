"""Sentences for people where something went wrong: at most 25 words, where they are declared."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from core.parameters.catalogue import CATALOGUE
from server.report.wording import NO_NORM, REASONS
from tests.data import ROOT

MOST_WORDS: Final = 25

SAID: Final = re.compile(r"^(Notice|\w+Error|Problem|Offer)$")
"""Classes whose arguments people read."""


def sentences(source: str) -> Iterator[tuple[int, str]]:
    """Line and text of every sentence that a notice or an error declares; a value inside counts as a word."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and SAID.match(_name(node.func)):
            for argument in (*node.args, *(k.value for k in node.keywords)):
                for part in re.split(r"(?<=[.!?])\s+(?=[A-Z…])", _text(argument)):
                    yield node.lineno, part


def _name(func: ast.expr) -> str:
    return func.attr if isinstance(func, ast.Attribute) else func.id if isinstance(func, ast.Name) else ""


def _text(node: ast.expr) -> str:
    """Text of a literal, values as one word; "" for what is computed elsewhere."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(v) if isinstance(v, ast.Constant) else "value" for v in node.values)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _text(node.left) + _text(node.right)
    return ""


def too_long(source: str) -> list[str]:
    """Sentences with more words than are read at a glance."""
    return [f"{line}: {text}" for line, text in sentences(source) if len(text.split()) > MOST_WORDS]


FILES: Final = sorted(path for part in ("core", "server") for path in (ROOT / part).rglob("*.py"))


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_sentences_for_people_are_short(path: Path) -> None:
    assert too_long(path.read_text("utf-8")) == []


def test_definitions_and_reasons_are_short() -> None:
    said = [*(e.definition for e in CATALOGUE.values()), *REASONS.values(), *NO_NORM.values()]
    assert [t for t in said for part in t.split(". ") if len(part.split()) > MOST_WORDS] == []


def test_a_long_sentence_is_found() -> None:
    long = " ".join(["word"] * 26)
    assert too_long(f"Notice('code', f'{long[:-5]} {{x}}.')") != []
    assert too_long(f"FormatError('code', 'Short. ' 'W{long[1:-5]}.')") == []
