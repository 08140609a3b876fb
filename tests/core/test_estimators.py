"""The one list of pose estimators: complete, documented, and its names nowhere else in the source."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import pytest

from sagittal.core.body.choice import list_possible_estimators
from sagittal.core.body.tree import PRESETS
from sagittal.core.estimators import (
    AUTO,
    BY_METHOD,
    BY_NAME,
    ESTIMATORS,
    LINKED_PATHS,
    LIVE_LINKED_PATHS,
    LIVE_SINGLE_PATHS,
    SINGLE_PATHS,
    SQUAT_CHAIN,
    Estimator,
    PoseEstimator,
    PoseMethod,
    Requested,
)
from tests.data import ROOT

NAMES = {e.name for e in ESTIMATORS} | set(BY_METHOD)
NAMES |= {LINKED_PATHS, SINGLE_PATHS, LIVE_LINKED_PATHS, LIVE_SINGLE_PATHS}

LIST = ROOT / "core" / "estimators.py"


def texts(tree: ast.AST) -> Iterator[str]:
    """All strings of a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def sources(*endings: str) -> Iterator[Path]:
    for room in ("core", "server", "web", "sagittal"):
        for path in sorted((ROOT / room).rglob("*")):
            if path.suffix in endings and "vendor" not in path.parts and path != LIST:
                yield path


@pytest.mark.sweep
def test_the_names_are_written_in_the_list_alone() -> None:
    found = [
        (str(path.relative_to(ROOT)), text)
        for path in sources(".py")
        for text in texts(ast.parse(path.read_text("utf-8")))
        if text in NAMES or any(name in text for name in NAMES if "_" in name)
    ]
    found += [
        (str(path.relative_to(ROOT)), name)
        for path in sources(".js", ".html", ".css", ".json")
        for name in NAMES
        if name in path.read_text("utf-8", errors="replace")
    ]
    assert found == []


def test_the_list_is_complete() -> None:
    assert tuple(e.name for e in ESTIMATORS) == get_args(Estimator)
    assert get_args(Requested) == (AUTO, *get_args(Estimator))
    assert len(BY_NAME) == len(ESTIMATORS)
    assert set(BY_METHOD.values()) == {*ESTIMATORS, SQUAT_CHAIN}


def test_what_can_run_is_what_the_list_says_of_every_set_of_sensors() -> None:
    whole = PRESETS["lower_body7"]
    for chosen in range(2 ** len(whole)):
        worn = {s for i, s in enumerate(whole) if chosen >> i & 1}
        assert set(list_possible_estimators(worn)) == {e.name for e in ESTIMATORS if e.runs_on(worn)}


@pytest.mark.parametrize("method", [*ESTIMATORS, SQUAT_CHAIN], ids=lambda m: m.method)
def test_the_documents_have_its_names_its_equations_and_its_paper(method: PoseMethod) -> None:
    overview = (ROOT / "docs" / "reference" / "estimators.md").read_text("utf-8")
    names = (
        (method.name, method.choice) if isinstance(method, PoseEstimator) else (method.method, method.label)
    )
    assert f"`{names[0]}`" in overview
    assert names[1] in overview
    science = (ROOT / method.science).read_text("utf-8")
    if method.paper is not None:
        assert method.paper.doi in science
        assert method.paper.doi in overview
