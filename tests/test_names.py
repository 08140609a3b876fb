"""Names: a public class is called one thing in the whole repository, a function says what it does."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("core", "sagittal", "server")

PARTICIPLES = {
    "begun", "broken", "chosen", "done", "drawn", "found", "given", "gone", "grown", "held", "kept", "known",
    "lost", "made", "met", "seen", "sent", "shaken", "shown", "spoken", "taken", "told", "worn", "written",
}  # fmt: skip
VERBS = {"embed", "exceed", "feed", "need", "seed", "speed"}
"""Words in -ed that are no participles."""


def is_participle(word: str) -> bool:
    """Whether a word says what has been done instead of what to do."""
    return word in PARTICIPLES or (word.endswith("ed") and word not in VERBS)


def list_files() -> list[Path]:
    return sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py"))


def find_shared_names(sources: dict[str, str]) -> dict[str, set[str]]:
    """Public class → files that define it, where there are several; sources: file → text."""
    homes: defaultdict[str, set[str]] = defaultdict(set)
    for file, text in sources.items():
        for node in ast.parse(text).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes[node.name].add(file)
    return {name: files for name, files in homes.items() if len(files) > 1}


def find_participles(source: str) -> list[str]:
    """Public functions of a module whose name begins with a participle."""
    functions = (n for n in ast.parse(source).body if isinstance(n, (ast.FunctionDef, ast.AsyncFunctionDef)))
    return [f.name for f in functions if is_participle(f.name.split("_")[0])]


def test_a_public_class_name_is_unique() -> None:
    sources = {str(path.relative_to(ROOT)): path.read_text() for path in list_files()}
    assert find_shared_names(sources) == {}


@pytest.mark.parametrize("folder", FOLDERS)
def test_functions_say_what_they_do(folder: str) -> None:
    named = {
        str(path.relative_to(ROOT)): names
        for path in list_files()
        if path.is_relative_to(ROOT / folder) and (names := find_participles(path.read_text()))
    }
    assert named == {}


def test_the_check_finds_what_it_looks_for() -> None:
    assert find_shared_names({"a.py": "class Line: ...", "b.py": "class Line: ...\nclass _Row: ..."}) == {
        "Line": {"a.py", "b.py"}
    }
    source = "def told(): ...\ndef feed(): ...\ndef edited_events(): ...\ndef _held(): ..."
    assert find_participles(source) == ["told", "edited_events"]
