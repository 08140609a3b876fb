"""The repository stands alone: what code and documents refer to is in it, and nothing points outside.

References are pages and headings of docs/ in code and documents (`docs/page.md, "Heading"`), Markdown links
with their anchors, and paths of source files.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from tests.data import ROOT

FOLDERS: Final = (".ci", "core", "docs", "migrations", "sagittal", "server", "tests", "web")
SUFFIXES: Final = {".css", ".html", ".js", ".mako", ".md", ".py", ".toml"}
NAMES: Final = {".importlinter", "Dockerfile", "run"}

PAGE: Final = re.compile(r"(?<![\w./])(?<!\]\()docs/(?:[a-z-]+/)*[\w-]+\.md(?:#[\w-]+)?")
LINK: Final = re.compile(r"\]\(([^)\s]+)\)")
HEADINGS: Final = re.compile(r'\s*(?:[,:]|,? and)\s+(?:\\?"([^"\\]+)\\?"|\*([^*]+)\*)')
SOURCE: Final = re.compile(r"(?<![\w./<-])(?:core|server|tests|web)/[\w./-]+\.(?:py|js|css|html|md|csv)\b")

OUTSIDE: Final = {
    "a design file": re.compile(
        r"\b(?:spec|design|review|prototypes)/[a-z0-9_-]+(?:\.md|/)|\b(?:spec|design) §|\bDESIGN\.md"
        r"|(?<![\w/-])(?:service|viewer|experience|clinic|fusion|patients|kernels|real-data|field|architecture)\.md"
    ),
    "a path of a machine": re.compile(r"(?<![\w.])/(?:work|root|home)/"),
    "a folder beside the repository": re.compile(r"\.\./shared"),
}
"""What is outside → how it is written."""


def texts(root: Path) -> Iterator[tuple[Path, str]]:
    """Text files of the repository but this one: path from its root, content."""
    inside = [p for folder in FOLDERS for p in sorted((root / folder).rglob("*"))]
    for path in (*sorted(root.iterdir()), *inside):
        name = path.relative_to(root)
        wanted = path.suffix in SUFFIXES or path.name in NAMES
        if wanted and path.is_file() and name != Path("tests/test_references.py"):
            yield name, path.read_text("utf-8")


def headings(page: Path) -> tuple[set[str], set[str]]:
    """Headings of a page, and their anchors as GitHub makes them."""
    plain = re.sub(r"^```.*?^```", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
    titles = [t.strip() for t in re.findall(r"^#+ (.+)$", plain, flags=re.MULTILINE)]
    anchors: set[str] = set()
    for title in titles:
        slug = re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
        twins = sum(a == slug or re.fullmatch(rf"{re.escape(slug)}-\d+", a) is not None for a in anchors)
        anchors.add(slug if not twins else f"{slug}-{twins}")
    return set(titles), anchors


def one_line(path: Path, text: str) -> str:
    """The text with the breaks of its lines taken out, so that a reference may go on in the next."""
    if path.suffix == ".py":
        text = re.sub(r'(?<=[^"\s])"\n\s*f?"(?!")', "", text)
    return re.sub(r"\n\s*(?:#|//|\*)? *", " ", text)


def missing(root: Path) -> list[str]:
    """References that lead nowhere, each with the file that has it."""
    found = []
    known: dict[Path, tuple[set[str], set[str]]] = {}
    for path, text in texts(root):
        plain = one_line(path, text)
        targets = [(m, root / m.group().partition("#")[0]) for m in PAGE.finditer(plain)]
        if path.suffix == ".md":
            local = (m for m in LINK.finditer(plain) if not re.match(r"[a-z]+:", m[1]))
            targets += [(m, (root / path).parent / (m[1].partition("#")[0] or path.name)) for m in local]
        for m, page in targets:
            if not page.exists() or not page.resolve().is_relative_to(root.resolve()):
                found.append(f"{path}: {m.group()}")
                continue
            if page.suffix != ".md":
                continue
            if page not in known:
                known[page] = headings(page)
            titles, anchors = known[page]
            anchor = m.group().rstrip(")").partition("#")[2]
            if anchor and anchor not in anchors:
                found.append(f"{path}: {m.group()}")
            found += [
                f"{path}: {page.name}, {title}" for title in cited(plain, m.end()) if title not in titles
            ]
        found += [f"{path}: {m[0]}" for m in SOURCE.finditer(plain) if not (root / m[0]).exists()]
    return found


def cited(text: str, at: int) -> Iterator[str]:
    """Headings named right behind a reference to a page."""
    while (m := HEADINGS.match(text, at)) is not None:
        yield m[1] or m[2]
        at = m.end()


def mentions(root: Path) -> list[str]:
    """Mentions of what lies outside of the repository, each with the file that has it."""
    return [
        f"{path}: {what}, {m.group()}"
        for path, text in texts(root)
        for what, pattern in OUTSIDE.items()
        for m in pattern.finditer(text)
    ]


def test_every_reference_leads_somewhere() -> None:
    assert missing(ROOT) == []


def test_nothing_outside_is_mentioned() -> None:
    assert mentions(ROOT) == []


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
        ("docs/page.md", "[a](../../outside.md)"),
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
        ("docs/page.md", "in ../shared"),
        ("tests/a.py", "A = '/home/anna/sagittal'"),
    ],
)
def test_a_planted_mention_of_what_is_outside_is_found(small: Path, name: str, text: str) -> None:
    plant(small, name, text)
    assert len(mentions(small)) == 1
