"""Length rule for notices and errors: at most 25 words a sentence, checked where they are declared."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from typing import Final

from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.server.report.words.wording import NO_NORM, REASONS
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
    """Text of a literal, with values as one word; "" for computed text."""
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


def find_long_sentences() -> list[str]:
    """Sentences of notices, errors, definitions and reasons with more than 25 words."""
    declared = [
        f"{path.relative_to(ROOT)}:{sentence}"
        for part in ("core", "server")
        for path in sorted((ROOT / part).rglob("*.py"))
        for sentence in too_long(path.read_text("utf-8"))
    ]
    texts = [*(e.definition for e in CATALOGUE.values()), *REASONS.values(), *NO_NORM.values()]
    return declared + [t for t in texts for part in t.split(". ") if len(part.split()) > MOST_WORDS]
