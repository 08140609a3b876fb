"""Run the validation: `python -m validation [PART ...]`.

Parts are accuracy, bench, faults, sweep, browser and postgresql; without one, all run. Units that passed on
the same code are skipped, so an interrupted validation resumes (`--again` repeats them). `--write` puts the
figures into validation/report.md and docs/reference/accuracy.md, which a release requires.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from tests.data import ROOT
from validation.figures import STORE
from validation.report import UnitResult, write_report

DEFAULT_STORE: Final = ROOT / ".validation"
HASHED: Final = ("core", "migrations", "sagittal", "server", "tests", "validation", "web")
"""Folders whose contents decide whether a stored result still holds."""
SWEEP: Final = re.compile(r"\bmark\.sweep\b|\bsweep_after\(")
"""A test with many variants, or the helper that marks those of its parameters."""
TENTHS: Final = 10
NO_TESTS: Final = 5
"""pytest's exit status when no test was collected."""


@dataclass(frozen=True)
class Unit:
    """A piece of the validation: one call of pytest.

    Parameters
    ----------
    part : the part it belongs to. name : unique, a path. arguments : of pytest.
    alone : whether it needs the machine to itself.
    """

    part: str
    name: str
    arguments: tuple[str, ...]
    alone: bool = False

    def stored(self, store: Path) -> Path:
        """File of its last result."""
        return store / f"{self.part}-{self.name.replace('/', '-')}.json"


def list_units() -> list[Unit]:
    """All units of the validation, in the order in which they run."""
    units = []
    for part, folder, single in (
        ("accuracy", "validation/accuracy", False),
        ("bench", "validation/bench", True),
        ("faults", "tests/faults", False),
        ("browser", "tests/browser", False),
    ):
        for path in sorted((ROOT / folder).glob("test_*.py")):
            name = str(path.relative_to(ROOT))
            units.append(Unit(part, name, (name,), single))
    units.append(Unit("bench", "tests", ("tests", "-m", "bench"), alone=True))
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        if SWEEP.search(path.read_text("utf-8")):
            name = str(path.relative_to(ROOT))
            units.append(Unit("sweep", name, (name, "-m", "sweep")))
    for path in sorted((ROOT / "tests" / "server").iterdir()):
        if path.is_dir() and any(path.glob("test_*.py")):
            name = str(path.relative_to(ROOT))
            marks = "not (slow or sweep or bench or browser or faults)"
            units.append(Unit("postgresql", name, (name, "-m", marks, "--engine", "postgresql")))
    return units


def hash_code() -> str:
    """Digest of everything that a result depends on."""
    digest = hashlib.sha256()
    for folder in HASHED:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts and path.name != "report.md":
                digest.update(str(path.relative_to(ROOT)).encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def run_unit(unit: Unit, store: Path, code: str, *, whole: bool) -> UnitResult:
    """Run one unit and store its result and its log."""
    stored = unit.stored(store)
    figures = stored.with_suffix(".figures")
    figures.unlink(missing_ok=True)
    environment = {**os.environ, STORE: str(figures), "SAGITTAL_VALIDATION": "whole" if whole else "sample"}
    command = [sys.executable, "-m", "pytest", "-n", "0", "-q", *unit.arguments]
    began, position = time.monotonic(), datetime.now(UTC).isoformat(timespec="seconds")
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    stored.with_suffix(".log").write_text(done.stdout + done.stderr, encoding="utf-8")
    lines = [line for line in done.stdout.splitlines() if line.strip()]
    outcome = {0: "passed", NO_TESTS: "skipped"}.get(done.returncode, "failed")
    recorded = figures.read_text("utf-8").splitlines() if figures.exists() else []
    figures.unlink(missing_ok=True)
    result = UnitResult(
        unit.name,
        outcome,
        lines[-1].strip("= ") if lines else "",
        time.monotonic() - began,
        code,
        position,
        whole,
        [json.loads(line) for line in recorded],
    )
    stored.write_text(json.dumps(asdict(result), ensure_ascii=False, indent=1), encoding="utf-8")
    return result


def print_result(result: UnitResult, store: Path, unit: Unit) -> None:
    """Print one line for a result, and the end of its log if it failed."""
    sys.stdout.write(
        f"{result.outcome:8}{result.seconds:7.0f} s  {unit.part}: {unit.name}  {result.summary}\n"
    )
    log = unit.stored(store).with_suffix(".log").read_text("utf-8")
    if result.outcome == "failed":
        sys.stdout.write("\n".join(log.splitlines()[-40:]) + "\n")
    sys.stdout.flush()


def run(
    units: Sequence[Unit], store: Path, *, whole: bool, again: bool, jobs: int, seconds: float
) -> list[UnitResult]:
    """Run units, those that can share the machine `jobs` at a time, and return all results.

    Parameters
    ----------
    again : whether to repeat units that passed on the same code. seconds : none is started after this time.
    """
    code, end = hash_code(), time.monotonic() + seconds
    store.mkdir(parents=True, exist_ok=True)

    def run_one(unit: Unit) -> UnitResult | None:
        last = UnitResult.read(unit.stored(store))
        if last and last.code == code and last.outcome != "failed" and last.whole >= whole and not again:
            sys.stdout.write(f"skipped, {last.outcome} on the same code: {unit.name}\n")
            return last
        if time.monotonic() > end:
            sys.stdout.write(f"not started, time is up: {unit.name}\n")
            return None
        result = run_unit(unit, store, code, whole=whole)
        print_result(result, store, unit)
        return result

    with ThreadPoolExecutor(jobs) as pool:
        results = list(pool.map(run_one, (u for u in units if not u.alone)))
    results += [run_one(unit) for unit in units if unit.alone]
    return [r for r in results if r is not None]


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser("python -m validation", description=__doc__)
    parts = sorted({u.part for u in list_units()})
    parser.add_argument("part", nargs="*", help=f"{', '.join(parts)}, or the path of a unit; default: all")
    parser.add_argument("--list", action="store_true", help="list the units")
    parser.add_argument("--again", action="store_true", help="repeat units that passed on the same code")
    parser.add_argument("--sample", action="store_true", help="only a sample of the expensive cases")
    parser.add_argument(
        "--write", action="store_true", help="write validation/report.md and docs/reference/accuracy.md"
    )
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="units at a time (default: 2)")
    parser.add_argument(
        "--store", type=Path, default=DEFAULT_STORE, metavar="DIR", help="results of earlier runs"
    )
    parser.add_argument(
        "--tenth", type=int, metavar="N", help=f"only every {TENTHS}th unit, starting with N modulo {TENTHS}"
    )
    parser.add_argument(
        "--within", type=float, default=float("inf"), metavar="S", help="start no unit after S seconds"
    )
    options = parser.parse_args(arguments)
    reference = {*parts, *(u.name for u in list_units())}
    if unknown := [p for p in options.part if p not in reference]:
        parser.error(f"no part or unit is called {', '.join(unknown)}; --list lists them")
    if options.write and options.sample:
        parser.error("--write needs all cases: leave out --sample")
    return options


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the requested units; 1 if one failed."""
    options = parse(arguments)
    units = [u for u in list_units() if not options.part or {u.part, u.name} & set(options.part)]
    if options.tenth is not None:
        units = units[options.tenth % TENTHS :: TENTHS]
    if options.list:
        sys.stdout.writelines(f"{u.part}: {u.name}\n" for u in units)
        return 0
    results = run(
        units,
        options.store,
        whole=not options.sample,
        again=options.again,
        jobs=options.jobs,
        seconds=options.within,
    )
    failed = sum(r.outcome == "failed" for r in results)
    sys.stdout.write(f"{len(results)} units, {failed} failed; logs are in {options.store}\n")
    if options.write:
        write_report(results)
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
