"""Naming rules: public class names are unique, function names begin with no participle."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

from tests.data import ROOT

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


def find_repeated_class_names() -> list[str]:
    """Public classes that several modules define."""
    sources = {str(path.relative_to(ROOT)): path.read_text() for path in list_files()}
    return [f"{name}: {', '.join(sorted(files))}" for name, files in find_shared_names(sources).items()]


def find_participle_functions() -> list[str]:
    """Public functions whose name begins with a participle."""
    return [
        f"{path.relative_to(ROOT)}: {name}"
        for path in list_files()
        for name in find_participles(path.read_text())
    ]
