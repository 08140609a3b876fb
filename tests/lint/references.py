"""References in code and documents lead to existing targets in the repository, and none lead outside.

References are pages and headings of docs/ (`docs/page.md, "Heading"`), Markdown links with anchors, and paths
of source files.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from tests.data import ROOT

FOLDERS: Final = (".ci", "core", "docs", "migrations", "sagittal", "server", "tests", "validation", "web")
SUFFIXES: Final = {".css", ".html", ".js", ".mako", ".md", ".py", ".toml"}
NAMES: Final = {".importlinter", "Dockerfile", "run"}

PAGE: Final = re.compile(r"(?<![\w./])(?<!\]\()(?:docs|validation)/(?:[a-z-]+/)*[\w-]+\.md(?:#[\w-]+)?")
LINK: Final = re.compile(r"\]\(([^)\s]+)\)")
HEADINGS: Final = re.compile(r'\s*(?:[,:]|,? and)\s+(?:\\?"([^"\\]+)\\?"|\*([^*]+)\*)')
SOURCE: Final = re.compile(
    r"(?<![\w./<-])(?:core|server|tests|validation|web)/[\w./-]+\.(?:py|js|css|html|md|csv)\b"
)

THESE: Final = (Path("tests/lint/references.py"), Path("tests/lint/test_references.py"))
"""They contain the patterns and the planted faults."""

OUTSIDE: Final = {
    "a design file": re.compile(
        r"\b(?:spec|design|review|prototypes)/[a-z0-9_-]+(?:\.md|/)|\b(?:spec|design) §|\bDESIGN\.md"
        r"|(?<![\w/-])(?:service|viewer|experience|clinic|fusion|patients|kernels|real-data|field)\.md"
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
        expected = path.suffix in SUFFIXES or path.name in NAMES
        if expected and path.is_file() and name not in THESE:
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
    """Text without line breaks, so that references may continue on the next line."""
    if path.suffix == ".py":
        text = re.sub(r'(?<=[^"\s])"\n\s*f?"(?!")', "", text)
    return re.sub(r"\n\s*(?:#|//|\*)? *", " ", text)


def missing(root: Path) -> list[str]:
    """References that lead nowhere, each with the file that has it."""
    result = []
    reference: dict[Path, tuple[set[str], set[str]]] = {}
    for path, text in texts(root):
        plain = one_line(path, text)
        targets = [(m, root / m.group().partition("#")[0]) for m in PAGE.finditer(plain)]
        if path.suffix == ".md":
            local = (m for m in LINK.finditer(plain) if not re.match(r"[a-z]+:", m[1]))
            targets += [(m, (root / path).parent / (m[1].partition("#")[0] or path.name)) for m in local]
        for m, page in targets:
            if not page.exists() or not page.resolve().is_relative_to(root.resolve()):
                result.append(f"{path}: {m.group()}")
                continue
            if page.suffix != ".md":
                continue
            if page not in reference:
                reference[page] = headings(page)
            titles, anchors = reference[page]
            anchor = m.group().rstrip(")").partition("#")[2]
            if anchor and anchor not in anchors:
                result.append(f"{path}: {m.group()}")
            result += [
                f"{path}: {page.name}, {title}" for title in cited(plain, m.end()) if title not in titles
            ]
        result += [f"{path}: {m[0]}" for m in SOURCE.finditer(plain) if not (root / m[0]).exists()]
    return result


def cited(text: str, position: int) -> Iterator[str]:
    """Headings named directly after a reference to a page."""
    while (m := HEADINGS.match(text, position)) is not None:
        yield m[1] or m[2]
        position = m.end()


def mentions(root: Path) -> list[str]:
    """Mentions of files outside the repository, with the file that contains them."""
    return [
        f"{path}: {label}, {m.group()}"
        for path, text in texts(root)
        for label, pattern in OUTSIDE.items()
        for m in pattern.finditer(text)
    ]


def find_broken_references() -> list[str]:
    """References of this repository that lead nowhere."""
    return missing(ROOT)


def find_outside_mentions() -> list[str]:
    """Mentions in this repository of files outside of it."""
    return mentions(ROOT)
