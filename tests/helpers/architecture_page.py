"""Generate the diagram of docs/reference/architecture.md: `python -m tests.helpers.architecture_page`.

Boxes are the folders of core and server, and web and sagittal as a whole, labelled with the first sentence of
their docstring. Arrows are imports, without those implied by others. Top-level modules (core/errors.py,
server/main.py) have no box.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from tests.data import ROOT

PAGE: Final = ROOT / "docs" / "reference" / "architecture.md"

PICTURE: Final = re.compile(r"(<!-- rooms -->\n).*?(?=<!-- end -->)", re.DOTALL)

DIVIDED: Final = ("core", "server")
WHOLE: Final = ("sagittal", "web")
"""Packages whose folders are rooms, and packages that are one room each."""


def find_rooms(root: Path = ROOT) -> dict[str, str]:
    """Every room and the first sentence of its docstring."""
    folders = [p.parent for top in DIVIDED for p in sorted((root / top).glob("*/__init__.py"))]
    folders += [root / top for top in WHOLE]
    return {f.relative_to(root).as_posix(): _first_sentence(f / "__init__.py") for f in folders}


def find_arrows(root: Path = ROOT) -> set[tuple[str, str]]:
    """Pairs of rooms of which the first imports the second, without those that follow from others."""
    rooms = find_rooms(root)
    direct: dict[str, set[str]] = {room: set() for room in rooms}
    for room in rooms:
        for path in _modules(root / room, whole=room in WHOLE):
            direct[room] |= {to for to in map(_room_of, _imports(path)) if to in rooms and to != room}
    return {
        (room, to)
        for room, targets in direct.items()
        for to in targets
        if not any(to in _reached(direct, second) for second in targets - {to})
    }


def render_picture(root: Path = ROOT) -> str:
    """The picture as Mermaid."""
    rooms = find_rooms(root)
    lines = ["```mermaid", "flowchart TB"]
    for top in DIVIDED:
        lines.append(f'subgraph {top}["{top}/"]')
        lines += [_box(room, rooms[room]) for room in rooms if room.startswith(f"{top}/")]
        lines.append("end")
    lines += [_box(room, rooms[room]) for room in rooms if room in WHOLE]
    lines += [f"{_name(room)} --> {_name(to)}" for room, to in sorted(find_arrows(root))]
    return "\n".join([*lines, "```", ""])


def render_page(text: str, root: Path = ROOT) -> str:
    """The page with the picture as the sources have it."""
    return PICTURE.sub(lambda found: found[1] + render_picture(root), text)


def _modules(folder: Path, *, whole: bool) -> Iterator[Path]:
    """Modules of a room; the links to other packages in sagittal are no part of it."""
    yield from sorted(folder.glob("*.py") if whole else folder.rglob("*.py"))


def _imports(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _room_of(module: str) -> str:
    parts = module.split(".")
    if parts[0] != "sagittal":
        return ""
    if len(parts) == 1 or parts[1] not in (*DIVIDED, "web"):
        return "sagittal"
    return "web" if parts[1] == "web" else "/".join(parts[1:3])


def _reached(direct: dict[str, set[str]], start: str) -> set[str]:
    observations: set[str] = set()
    left = list(direct[start])
    while left:
        room = left.pop()
        if room not in observations:
            observations.add(room)
            left += direct[room]
    return observations


def _first_sentence(path: Path) -> str:
    text = ast.get_docstring(ast.parse(path.read_text("utf-8"))) or ""
    sentence = re.split(r"(?<=\.)\s", text.split("\n\n")[0].replace("\n", " "), maxsplit=1)[0]
    return re.sub(r"\s*\(docs/[^)]*\)|`", "", sentence).rstrip(".").replace('"', "'")


def _name(room: str) -> str:
    return room.replace("/", "_")


def _box(room: str, purpose: str) -> str:
    return f'{_name(room)}["<b>{room.split("/")[-1]}</b><br>{purpose}"]'


def write_page(path: Path = PAGE) -> None:
    """Draw the picture into the page."""
    path.write_text(render_page(path.read_text("utf-8")), "utf-8")


if __name__ == "__main__":
    write_page()
