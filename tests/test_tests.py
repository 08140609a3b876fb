"""The laws of the tests: each says what it expects, and only those that measure speed limit seconds."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path

import pytest

from tests.data import HERE, ROOT, data_folder

TESTS = ROOT / "tests"
EXPECT = {"raises", "warns", "fail", "expect"}
"""What pytest and playwright call an assertion."""
CLOCKS = {"monotonic", "perf_counter", "process_time", "thread_time", "monotonic_ns", "perf_counter_ns"}

Function = ast.FunctionDef | ast.AsyncFunctionDef


@cache
def modules() -> dict[Path, ast.Module]:
    return {path: ast.parse(path.read_text("utf-8")) for path in sorted(TESTS.rglob("*.py"))}


@cache
def functions(tree: ast.AST) -> Sequence[Function]:
    return [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]


@cache
def called(function: ast.AST) -> set[str]:
    """Names of what is called, or waited in by `with`, without what stands before the dot."""
    calls = (node.func for node in ast.walk(function) if isinstance(node, ast.Call))
    return {getattr(f, "attr", getattr(f, "id", "")) for f in calls}


@cache
def asserts(function: ast.AST) -> bool:
    return any(
        isinstance(node, ast.Assert)
        or (isinstance(node, ast.Raise) and "AssertionError" in ast.unparse(node))
        for node in ast.walk(function)
    )


def find_checking_names(trees: Iterable[ast.Module]) -> set[str]:
    """Functions of tests and their helpers that assert, directly or by what they call."""
    found = [f for tree in trees for f in functions(tree)]
    names = EXPECT | {f.name for f in found if asserts(f)}
    calls = [(f.name, called(f)) for f in found]
    while more := {name for name, of in calls if name not in names and of & names}:
        names |= more
    return names


def find_mute_tests(tree: ast.Module, checking: set[str]) -> list[str]:
    """Tests that can only fail by an accident: no assertion, no call of what asserts, no limited wait."""
    return [
        f.name
        for f in functions(tree)
        if f.name.startswith("test_")
        and not (asserts(f) or called(f) & checking or any("assert_" in name for name in called(f)))
    ]


def find_limits_in_seconds(tree: ast.Module) -> list[str]:
    """Assertions that something took less than some time, as `test: assertion`."""
    found = []
    for f in functions(tree):
        if any("bench" in ast.unparse(decorator) for decorator in f.decorator_list):
            continue
        names: set[str] = set()
        if not called(f) & CLOCKS:
            continue
        for node in ast.walk(f):
            if isinstance(node, ast.Assign) and _is_duration(node.value, names):
                names |= {n.id for t in node.targets for n in ast.walk(t) if isinstance(n, ast.Name)}
        found += [
            f"{f.name}: {ast.unparse(node)}"
            for node in ast.walk(f)
            if isinstance(node, ast.Assert) and any(_is_upper_limit(c, names) for c in ast.walk(node.test))
        ]
    return found


def _is_duration(node: ast.AST, names: set[str]) -> bool:
    return any(
        (isinstance(n, ast.Name) and n.id in names)
        or (isinstance(n, ast.BinOp) and isinstance(n.op, ast.Sub) and bool(called(n) & CLOCKS))
        for n in ast.walk(node)
    )


def _is_upper_limit(node: ast.AST, names: set[str]) -> bool:
    if not isinstance(node, ast.Compare):
        return False
    terms = [node.left, *node.comparators]
    return any(
        (isinstance(op, ast.Lt | ast.LtE) and _is_duration(a, names))
        or (isinstance(op, ast.Gt | ast.GtE) and _is_duration(b, names))
        for op, a, b in zip(node.ops, terms[:-1], terms[1:], strict=True)
    )


def test_every_test_expects_something() -> None:
    trees = modules()
    checking = find_checking_names(trees.values())
    mute = {
        str(path.relative_to(TESTS)): names
        for path, tree in trees.items()
        if (names := find_mute_tests(tree, checking))
    }
    assert mute == {}


def test_a_mute_test_is_found_and_one_that_asks_a_helper_is_not() -> None:
    tree = ast.parse(
        "def check(x): assert x\n"
        "def ask(x): check(x)\n"
        "def test_asks(): ask(1)\n"
        "def test_refuses():\n    with pytest.raises(ValueError): int('x')\n"
        "def test_says_nothing(): print(len('abc'))\n"
    )
    assert find_mute_tests(tree, find_checking_names([tree])) == ["test_says_nothing"]


def test_only_tests_of_speed_limit_seconds() -> None:
    limits = {
        str(path.relative_to(TESTS)): found
        for path, tree in modules().items()
        if path.parent.name != "bench" and (found := find_limits_in_seconds(tree))
    }
    assert limits == {}


@pytest.mark.parametrize(
    "limit", ["time.monotonic() - began < 2", "took <= 2", "2 > took", "0.1 < took < 2", "best < 2"]
)
def test_a_limit_in_seconds_is_found(limit: str) -> None:
    source = f"""
def test():
    began = time.perf_counter()
    took = time.perf_counter() - began
    best = min(1, took)
    assert {limit}
"""
    assert len(find_limits_in_seconds(ast.parse(source))) == 1


def test_a_limited_wait_and_a_shortest_time_are_none() -> None:
    source = "def test():\n    assert clock.monotonic() < end\n    assert time.monotonic() - began > 2"
    assert find_limits_in_seconds(ast.parse(source)) == []


def test_the_recordings_in_this_folder_are_the_very_files_of_the_others() -> None:
    """So what passes without the others need not run again with them."""
    base = data_folder()
    own = [p.relative_to(HERE) for p in HERE.rglob("*.csv")]
    assert own
    for name in own:
        assert (HERE / name).read_bytes() == (base / name).read_bytes()
