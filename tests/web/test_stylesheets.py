"""Stylesheets match the pages: no unused class, no class without a rule."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from tests.data import ROOT

WEB: Final = ROOT / "web"
SOURCES: Final = (WEB, ROOT / "server" / "report", ROOT / "server" / "viewer")
ANY: Final = "\0"
"""Stands in a text for what is only known at run time: in the name of a class the letter of a side (l, r, b)
or nothing."""

HOOKS: Final = {"form-error", "own"}
"""Classes of templates that no rule styles: scripts find elements by them."""

WORDS: Final = re.compile(rf"[\w{ANY}-]+(?: [\w{ANY}-]+){{0,3}}")
ATTRIBUTE: Final = re.compile(rf'class="([\w {ANY}-]*)"')


@pytest.mark.slow
def test_every_styled_class_is_used() -> None:
    used = set(template_classes()) | set(script_classes()) | set(python_classes())
    plain = {name for name in used if ANY not in name}
    shapes = [re.compile(re.escape(n).replace(ANY, "[blr]?")) for n in used - plain if n.strip(ANY)]
    dead = {c for c in styled_classes() - plain if not any(shape.fullmatch(c) for shape in shapes)}
    assert not dead, f"no page has these classes: {sorted(dead)}"


def test_every_class_of_a_template_is_styled() -> None:
    names = {name for name in template_attributes() if ANY not in name}
    unstyled = names - styled_classes()
    assert unstyled == HOOKS, f"no rule for {sorted(unstyled - HOOKS)}; not there {sorted(HOOKS - unstyled)}"


@pytest.mark.slow
def test_the_finders_find() -> None:
    assert {"card", "kpi", "ps-msg", "tl-cursor"} <= styled_classes()
    assert {"card", "kpi"} <= set(template_attributes())
    assert {f"st{ANY}{ANY}", "tl-brush", "stale"} <= set(script_classes())
    assert {f"fos{ANY}", "trend-plot"} <= set(python_classes())


def styled_classes() -> set[str]:
    """Return the classes that the selectors of all stylesheets name."""
    result: set[str] = set()
    for sheet in WEB.rglob("*.css"):
        text = re.sub(r"/\*.*?\*/", "", sheet.read_text(), flags=re.DOTALL)
        for selector in re.findall(r"([^{};]+)\{", text):
            if not selector.lstrip().startswith("@"):
                result.update(re.findall(r"\.([a-zA-Z_][\w-]*)", selector))
    return result


def template_attributes() -> Iterator[str]:
    """Yield the classes that class attributes of templates name."""
    for text in templates():
        for written in re.findall(r'class="((?:\{\{.*?\}\}|\{%.*?%\}|[^"{])*)"', text, flags=re.DOTALL):
            for expression in re.findall(r"\{\{.*?\}\}", written):
                for branch in re.findall(r"'([\w -]*)' if |else '([\w -]*)'", expression):
                    yield from " ".join(branch).split()
            yield from re.sub(r"\{%.*?%\}", " ", re.sub(r"\{\{.*?\}\}", ANY, written)).split()


def template_classes() -> Iterator[str]:
    """Yield classes of templates, including blocks and macro arguments."""
    yield from template_attributes()
    for text in templates():
        for expression in re.findall(r"\{[{%](.*?)[%}]\}", text, flags=re.DOTALL):
            for quoted in re.findall(r"'([\w -]*)'", expression):
                yield from quoted.split()
        for block in re.findall(r"\{% block bodycls %\}([\w -]*)\{% endblock %\}", text):
            yield from block.split()


def templates() -> Iterator[str]:
    """Yield the text of every template without comments."""
    for path in (WEB / "templates").rglob("*.html"):
        yield re.sub(r"\{#.*?#\}", "", path.read_text(), flags=re.DOTALL)


def script_classes() -> Iterator[str]:
    """Yield possible class names in strings of all scripts."""
    for path in (WEB / "static" / "js").rglob("*.js"):
        text = re.sub(r"^\s*//.*$", "", path.read_text(), flags=re.MULTILINE)
        yield from classes_in(re.findall(r'"([^"\n]*)"', text))
        yield from classes_in(re.sub(r"\$\{[^{}]*\}", ANY, t) for t in re.findall(r"`([^`]*)`", text))


def python_classes() -> Iterator[str]:
    """Yield possible class names in strings of Python drawing code."""
    for path in (p for folder in SOURCES for p in folder.rglob("*.py")):
        yield from classes_in(strings_of(path))


def strings_of(path: Path) -> Iterator[str]:
    """Yield the strings of a module, formatted ones with `ANY` in the place of values; no docstrings."""
    tree = ast.parse(path.read_text())
    docstrings = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield "".join(str(v.value) if isinstance(v, ast.Constant) else ANY for v in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            yield node.value


def classes_in(texts: Iterator[str] | list[str]) -> Iterator[str]:
    """Yield the names in class attributes, and the words of texts that are nothing but up to four names."""
    for text in texts:
        for written in ATTRIBUTE.findall(text):
            yield from written.split()
        if WORDS.fullmatch(text):
            yield from text.split()


def test_only_links_are_underlined_under_the_pointer() -> None:
    """A fold that shares a class with plain links was underlined as a whole, fields and all."""
    names: list[str] = []
    for sheet in WEB.rglob("*.css"):
        for selectors, rules in re.findall(r"([^{};]+:hover)\s*\{([^{}]*)\}", sheet.read_text()):
            if "text-decoration: underline" in rules:
                names += [s.strip() for s in selectors.split(",")]
    assert names
    assert [s for s in names if not re.search(r"\ba(\.[\w-]+)?:hover$", s)] == []
