"""Test conventions: every test asserts, only benches limit seconds, and paths mirror the sources."""

from __future__ import annotations

import ast
from collections.abc import Collection, Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path

from tests.data import ROOT
from tests.lint.exceptions import FIXED_WAITS, UNMIRRORED

TESTS = ROOT / "tests"
ROOMS = ("core", "server")
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
    """Names of called functions and context managers, without their qualifier."""
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
    """Functions of tests and helpers that assert, directly or through their calls."""
    result = [f for tree in trees for f in functions(tree)]
    names = EXPECT | {f.name for f in result if asserts(f)}
    calls = [(f.name, called(f)) for f in result]
    while more := {name for name, source in calls if name not in names and source & names}:
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
    result = []
    for f in functions(tree):
        if any("bench" in ast.unparse(decorator) for decorator in f.decorator_list):
            continue
        names: set[str] = set()
        if not called(f) & CLOCKS:
            continue
        for node in ast.walk(f):
            if isinstance(node, ast.Assign) and _is_duration(node.value, names):
                names |= {n.id for t in node.targets for n in ast.walk(t) if isinstance(n, ast.Name)}
        result += [
            f"{f.name}: {ast.unparse(node)}"
            for node in ast.walk(f)
            if isinstance(node, ast.Assert) and any(_is_upper_limit(c, names) for c in ast.walk(node.test))
        ]
    return result


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


def find_tests_without_assertion() -> list[str]:
    """Tests that can only fail by accident."""
    trees = modules()
    checking = find_checking_names(trees.values())
    return [
        f"{path.relative_to(ROOT)}: {name}"
        for path, tree in trees.items()
        for name in find_mute_tests(tree, checking)
    ]


def find_timed_assertions() -> list[str]:
    """Assertions of a duration outside of benches."""
    return [
        f"{path.relative_to(ROOT)}: {limit}"
        for path, tree in modules().items()
        for limit in find_limits_in_seconds(tree)
    ]


def find_unmirrored_tests() -> list[str]:
    """Test files of core and server that are not at the path of the module or package they test."""
    paths = [p for room in ROOMS for p in sorted((TESTS / room).rglob("test_*.py"))]
    names = {str(p.relative_to(ROOT)) for p in paths if not _has_subject(p.relative_to(TESTS))}
    return compare_with_exceptions(names, UNMIRRORED)


def _has_subject(test: Path) -> bool:
    subject = ROOT / test.with_name(test.name.removeprefix("test_"))
    return subject.exists() or subject.with_suffix("").is_dir()


def find_untested_modules() -> list[str]:
    """Modules of core and server that no test imports and that have no test file of their own."""
    imported = {name for path in modules() for name in list_imports(modules()[path])}
    return sorted(
        str(path.relative_to(ROOT))
        for room in ROOMS
        for path in (ROOT / room).rglob("*.py")
        if path.name != "__init__.py"
        and ".".join(("sagittal", *path.relative_to(ROOT).with_suffix("").parts)) not in imported
        and not (ROOT / name_test(path.relative_to(ROOT))).exists()
    )


def name_test(module: Path) -> Path:
    """Where the test of a module belongs; both paths relative."""
    return Path("tests") / module.with_name(f"test_{module.name}")


def list_imports(tree: ast.Module) -> Iterator[str]:
    """Names of the modules that a module imports, and of all that may be one."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def find_fixed_waits() -> list[str]:
    """Tests that wait for a fixed time: a sleep outside of a loop that checks a condition."""
    names = {
        f"{path.relative_to(ROOT)}::{function.name}"
        for path, tree in modules().items()
        for function in functions(tree)
        if waits_for_fixed_time(function)
    }
    return compare_with_exceptions(names, FIXED_WAITS)


def waits_for_fixed_time(function: ast.AST, *, in_loop: bool = False) -> bool:
    """Whether a function calls a sleep outside of every loop."""
    for node in ast.iter_child_nodes(function):
        if isinstance(node, ast.Call) and not in_loop and _is_sleep(node):
            return True
        is_loop = isinstance(node, ast.While | ast.For | ast.AsyncFor)
        if not isinstance(node, Function) and waits_for_fixed_time(node, in_loop=in_loop or is_loop):
            return True
    return False


def _is_sleep(call: ast.Call) -> bool:
    name = getattr(call.func, "attr", getattr(call.func, "id", ""))
    is_zero = bool(call.args) and isinstance(call.args[0], ast.Constant) and call.args[0].value == 0
    return name in {"sleep", "wait_for_timeout"} and not is_zero


def compare_with_exceptions(violations: Collection[str], exceptions: Collection[str]) -> list[str]:
    """Violations that are no exception, and exceptions that are none any more: the lists may only shrink."""
    return [
        *sorted(set(violations) - set(exceptions)),
        *(f"remove the exception: {name}" for name in sorted(set(exceptions) - set(violations))),
    ]
