"""Mutation check: how many random faults of one line the quick tests notice.

`python -m validation.mutations --out FILE` draws mutations of core and server by cosmic-ray (`pip install
cosmic-ray`), each in a module drawn by its length. On each it runs the quick tests nearest to it: its own,
those that import the module, its package, or what imports it. With `--tree` another checkout, for which the
same packages are installed, is judged by its own tests on those mutations whose line it has. What FILE has
already is not repeated.
"""

from __future__ import annotations

import argparse
import ast
import json
import random
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Final

from tests.data import ROOT
from tests.lint.conventions import list_imports, name_test

ROOMS: Final = ("core", "server")
NEED_NAMES: Final = ("core/Variable",)
"""Operators that want to be told names of variables."""
LONGEST_S: Final = 240.0
"""What takes longer counts as noticed: a test would have run into its time limit."""
MOST_FILES: Final = 12
"""Test files a mutation is tried on, the nearest to its module first."""


@dataclass(frozen=True)
class Mutation:
    """One changed line.

    Parameters
    ----------
    path : of the module, relative. line : number from 1. before, after : its text. operator : of cosmic-ray.
    """

    path: str
    line: int
    before: str
    after: str
    operator: str


def draw_mutations(count: int, seed: int) -> list[Mutation]:
    """Draw mutations that change exactly one line each, without docstrings and imports."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator, operator_names

    rng = random.Random(seed)  # noqa: S311 - a sample, no secret
    paths = sorted(p for room in ROOMS for p in (ROOT / room).rglob("*.py"))
    sources = {p: p.read_text("utf-8") for p in paths}
    lengths = [len(sources[p].splitlines()) for p in paths]
    operators = sorted(n for n in operator_names() if not n.startswith(NEED_NAMES))
    result: list[Mutation] = []
    while len(result) < count:
        (path,) = rng.choices(paths, lengths)
        operator = rng.choice(operators)
        code = mutate_code(sources[path], get_operator(operator)(), rng.randrange(12))
        changed = _changed_line(sources[path], code) if code else None
        if changed is not None:
            mutation = Mutation(str(path.relative_to(ROOT)), *changed, operator)
            if mutation not in result:
                result.append(mutation)
    return result


def _changed_line(source: str, code: str) -> tuple[int, str, str] | None:
    initial, final = source.splitlines(), code.splitlines()
    if len(initial) != len(final):
        return None
    lines = [i for i, (a, b) in enumerate(zip(initial, final, strict=True)) if a != b]
    try:
        same = ast.dump(ast.parse(source)) == ast.dump(ast.parse(code))
    except SyntaxError:
        return None
    return None if same or len(lines) != 1 else (lines[0] + 1, initial[lines[0]], final[lines[0]])


def list_tests(tree: Path, module: str) -> list[str]:
    """Test files of a tree that are likeliest to notice a change of a module, the nearest first."""
    path = Path(module)
    dotted = ".".join(path.with_suffix("").parts)
    package = dotted.rpartition(".")[0]
    own = name_test(path)
    nearest = [str(own)] if (tree / own).exists() else []
    importers = {name for name, imported in _imports_below(tree, ROOMS).items() if dotted in imported}
    tests = _imports_below(tree, ("tests",))
    for expected in ({dotted}, {package}, importers):
        nearest += sorted(t for t, imported in tests.items() if expected & imported)
    files = (name if name.endswith(".py") else name.replace(".", "/") + ".py" for name in nearest)
    unique = [f for f in dict.fromkeys(files) if Path(f).name.startswith("test_")]
    return [f for f in unique if "/browser/" not in f and "/faults/" not in f][:MOST_FILES]


@cache
def _imports_below(tree: Path, folders: tuple[str, ...]) -> dict[str, frozenset[str]]:
    result = {}
    for folder in folders:
        for path in (tree / folder).rglob("*.py"):
            name = ".".join(path.relative_to(tree).with_suffix("").parts).removesuffix(".__init__")
            result[name] = frozenset(
                i.removeprefix("sagittal.") for i in list_imports(ast.parse(path.read_text("utf-8")))
            )
    return result


def judge(tree: Path, mutation: Mutation, marks: str) -> str:
    """Try the tests on one mutation: noticed, survived, or absent where the tree does not have that line."""
    path = tree / mutation.path
    lines = path.read_text("utf-8").splitlines(keepends=True) if path.exists() else []
    index = next((i for i, line in enumerate(lines) if line.rstrip("\n") == mutation.before), None)
    near = mutation.line - 1
    if near < len(lines) and lines[near].rstrip("\n") == mutation.before:
        index = near
    if index is None:
        return "absent"
    tests = list_tests(tree, mutation.path)
    if not tests:
        return "survived"
    source = "".join(lines)
    try:
        path.write_text("".join([*lines[:index], mutation.after + "\n", *lines[index + 1 :]]), "utf-8")
        command = [sys.executable, "-m", "pytest", "-n", "0", "-q", "-x", "-m", marks, *tests]
        done = subprocess.run(command, cwd=tree, capture_output=True, timeout=LONGEST_S, check=False)
    except subprocess.TimeoutExpired:
        return "noticed"
    finally:
        path.write_text(source, "utf-8")
    return "survived" if done.returncode in {0, 5} else "noticed"


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw, try, and print how many were noticed."""
    parser = argparse.ArgumentParser(prog="python -m validation.mutations", description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--tree", type=Path, default=ROOT, help="checkout that is changed and judged")
    parser.add_argument("--out", type=Path, required=True, help="one JSON object a mutation")
    parser.add_argument("--marks", default="not (slow or sweep or bench or browser or faults or postgres)")
    options = parser.parse_args(arguments)
    tree = options.tree.resolve()
    done = options.out.read_text("utf-8").splitlines() if options.out.exists() else []
    results: list[str] = [json.loads(line)["result"] for line in done]
    for mutation in draw_mutations(options.count, options.seed)[len(results) :]:
        results.append(judge(tree, mutation, options.marks))
        with options.out.open("a", encoding="utf-8") as out:
            out.write(json.dumps({**asdict(mutation), "result": results[-1]}) + "\n")
        sys.stdout.write(f"{len(results)}: {results[-1]} {mutation.path}:{mutation.line}\n")
        sys.stdout.flush()
    counts = {result: results.count(result) for result in sorted(set(results))}
    sys.stdout.write(f"{counts}\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
