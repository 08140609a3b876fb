"""Naming rules: public class names are unique, function names begin with no participle, API has namesakes."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping
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
    """Whether a word is a participle instead of an imperative."""
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


ROOMS = (
    ".", "auth", "clinic", "uploads", "results", "sharing", "live_takes", "downloads", "safekeeping", "pages"
)  # fmt: skip
"""Rooms of server in which what a module of server/api serves may be found."""

NAMED_OTHERWISE: Mapping[str, str] = {
    "account_schemas": "bodies and answers of sign_in, users, security_keys, second_factor and api_tokens",
    "documents": "the OpenAPI document itself",
    "downloads": "what all answers share that a browser saves as a file",
    "estimators": "a list of core.estimators, which needs no service",
    "feedback_schemas": "bodies and answers of prescriptions",
    "files": "of a recording: uploads/recordings; its address says files",
    "health": "asks storage/readiness",
    "live_feed": "the socket of live/hub",
    "live_schemas": "bodies and answers of live",
    "proofs": "asks auth/accounts and auth/second_factor for all routes of one's own account",
    "review_schemas": "bodies and answers of reviews",
    "schemas": "bodies and answers that have no module of their own",
    "trend_schemas": "answers of trends and comparisons",
}
"""Module of server/api → why no service and no page has its name."""


def find_strangers(modules: Iterable[str], homes: Collection[str], reference: Collection[str]) -> list[str]:
    """Modules without a namesake that no exception names, and exceptions that are none any more."""
    single_names = {name for name in modules if name not in homes}
    return [
        *sorted(single_names - set(reference)),
        *(f"remove the exception: {name}" for name in sorted(set(reference) - single_names)),
    ]


def find_unnamed_api() -> list[str]:
    """Modules of server/api that are not found by name from the service or page that they belong to."""
    server = ROOT / "server"
    homes = {path.stem for room in ROOMS for path in (server / room).glob("*.py")}
    homes |= {path.stem for path in (server / "pages").glob("*/*.py")} - {"__init__"}
    return find_strangers((path.stem for path in (server / "api").rglob("*.py")), homes, NAMED_OTHERWISE)
