"""Templates can be read: one element a line, none too long, and each is used."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import pytest
from jinja2 import meta

from sagittal.server.http.templates import load_templates
from tests.data import ROOT

TEMPLATES: Final = sorted((ROOT / "web" / "templates").glob("*.html"))
MOST_COLUMNS: Final = 120
MOST_LINES: Final = 250

INLINE: Final = "a|abbr|b|br|code|em|i|kbd|output|small|span|strong|svg|use|path"
"""Elements that may share a line: words and what stands among them."""

IMPORT: Final = re.compile(r'{%-? from "([^"]+)" import [^%]*?(with context)? ?-?%}')
ALONE: Final = (
    "_daily.html", "_devices.html", "_macros.html", "_params.html", "_programme.html", "_runs.html",
    "_squat_rows.html", "_steps.html", "_ten_rows.html", "_trends.html",
)  # fmt: skip
"""Files of macros that use their arguments only."""
SET_WITHIN: Final = {"_params.html": {"mean", "sd"}}
"""Names that a macro sets itself, several at a time, which Jinja does not see."""

BLOCK: Final = re.compile(rf"<(?!(?:{INLINE})\b)[a-z][\w-]*")


@pytest.mark.parametrize("path", TEMPLATES, ids=lambda p: p.name)
def test_a_template_can_be_read(path: Path) -> None:
    lines = path.read_text().splitlines()
    assert len(lines) <= MOST_LINES, "long sections are files of their own: {% include %}"
    for number, line in enumerate(lines, 1):
        assert len(line) <= MOST_COLUMNS, f"line {number}"
        assert len(BLOCK.findall(line)) <= 2, f"line {number} has several elements: {line.strip()}"


@pytest.mark.parametrize("path", TEMPLATES, ids=lambda p: p.name)
def test_a_text_of_many_lines_has_a_limit_that_cuts_nothing(path: Path) -> None:
    """`maxlength` makes browsers truncate pasted text; `data-limit` counts and keeps it."""
    for area in re.findall(r"<textarea\b.*?>", path.read_text(), re.DOTALL):
        assert "data-limit=" in area, area
        assert "maxlength=" not in area, area


@pytest.mark.parametrize("path", TEMPLATES, ids=lambda p: p.name)
def test_sentences_are_shown_one_by_one(path: Path) -> None:
    """Joined, one that begins with a small letter is taken for the end of the one before."""
    joined = re.findall(r"(?<!\"){{[^{}]*\| join\(' '\) }}", path.read_text())
    assert joined == []


def test_every_part_is_used() -> None:
    text = "\n".join(path.read_text() for path in TEMPLATES)
    unused = [p.name for p in TEMPLATES if p.name.startswith("_") and f'"{p.name}"' not in text]
    assert unused == []


def test_macros_that_use_nothing_of_a_page_are_made_once() -> None:
    """Macros imported with the page context would be compiled for every template."""
    env = load_templates("en").env
    anew = {
        (path.name, name)
        for path in TEMPLATES
        for name, with_context in IMPORT.findall(path.read_text())
        if with_context and name in ALONE
    }
    assert anew == set()
    for name in ALONE:
        source = (ROOT / "web" / "templates" / name).read_text()
        used = meta.find_undeclared_variables(env.parse(source)) - env.globals.keys()
        assert used <= SET_WITHIN.get(name, set()), f"{name} uses what its page has"
        assert not any(with_context for _, with_context in IMPORT.findall(source))


def test_no_page_takes_the_name_by_which_the_navigation_knows_where_it_is() -> None:
    """The page of algorithms called its own address so, and no entry of the navigation was marked."""
    assert [p.name for p in TEMPLATES if re.search(r"{%-? set here\b", p.read_text())] == []


def test_a_unit_stands_on_the_line_of_the_last_word() -> None:
    """Degree signs stay on the line of their number in narrow columns."""
    macros = load_templates("en").env.get_template("_params.html").module
    assert str(macros.unit("°")).startswith("&nbsp;<span")  # type: ignore[attr-defined]
