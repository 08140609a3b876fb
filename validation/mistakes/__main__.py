"""Run mistakes and count what becomes of them: `python -m validation.mistakes --out FILE [--runs N]`.

A run that FILE has is not repeated, so an interrupted one goes on. `--clean` lists the warnings that clean
recordings get. `--group` takes the recordings that chose limits, or those that only judge.
"""

from __future__ import annotations

import argparse
import json
import random
from collections import Counter, defaultdict
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from validation.mistakes.kinds import Mistake, list_mistakes
from validation.mistakes.takes import CHOOSING, JUDGING, SETS, analyse_clean, list_takes
from validation.mistakes.verdict import judge, list_warnings

GROUPS: Final = {"choosing": CHOOSING, "judging": JUDGING, "both": (*CHOOSING, *JUDGING)}


def draw_runs(names: tuple[str, ...], count: int | None, seed: int) -> list[tuple[str, str, Mistake]]:
    """Runs in order of recording: all, or so many that every kind and sensor set has about as many."""
    runs = [(n, k, m) for n, k in list_takes(names) for m in list_mistakes(SETS[k])]
    if count is None or count >= len(runs):
        return runs
    rng = random.Random(seed)  # noqa: S311 - a sample, no secret
    strata: dict[tuple[str, str], list[tuple[str, str, Mistake]]] = defaultdict(list)
    for run in runs:
        strata[run[1], run[2].kind].append(run)
    for part in strata.values():
        rng.shuffle(part)
    drawn: list[tuple[str, str, Mistake]] = []
    while len(drawn) < count:
        for part in strata.values():
            if part and len(drawn) < count:
                drawn.append(part.pop())
    return sorted(drawn, key=lambda x: (x[0], x[1], x[2].kind, x[2].size, x[2].sensor, x[2].moment))


def key_of(name: str, kind: str, m: Mistake) -> str:
    """Name of a run in the file."""
    return f"{name} | {kind} | {m.kind} | {m.size:g} | {m.sensor} | {m.moment:g}"


def run_all(runs: list[tuple[str, str, Mistake]], out: Path) -> dict[str, dict[str, Any]]:
    """Judge every run that the file does not have."""
    done = read_done(out)
    with out.open("a") as file:
        for name, kind, mistake in runs:
            key = key_of(name, kind, mistake)
            if key in done:
                continue
            clean = analyse_clean(name, kind)
            if clean is None:
                continue
            row = {"key": key, "take": name, "set": kind, **asdict(mistake), **asdict(judge(clean, mistake))}
            done[key] = row
            file.write(json.dumps(row) + "\n")
            file.flush()
    return {k: done[k] for k in (key_of(*run) for run in runs) if k in done}


def read_done(out: Path) -> dict[str, dict[str, Any]]:
    """Rows of an earlier run, by key."""
    if not out.exists():
        return {}
    return {row["key"]: row for row in map(json.loads, out.read_text().splitlines())}


def print_table(rows: dict[str, dict[str, Any]], by: str) -> None:
    """Counts of verdicts."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for row in rows.values():
        counts[row[by]][row["verdict"]] += 1
        counts[row[by]]["stays"] += row["stays"]
    counts["all"] = sum(counts.values(), Counter())
    print(
        f"{by:20} {'runs':>5} {'told':>5} {'repaired':>9} {'harmless':>9} {'silent':>7} {'number stays':>13}"
    )
    for name, c in counts.items():
        n = sum(c[v] for v in ("told", "repaired", "harmless", "silent"))
        cells = (c["told"], c["repaired"], c["harmless"], c["silent"], c["stays"])
        print(f"{name:20} {n:5} {cells[0]:5} {cells[1]:9} {cells[2]:9} {cells[3]:7} {cells[4]:13}")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="python -m validation.mistakes", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--runs", type=int, default=None)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--group", choices=GROUPS, default="both")
    parser.add_argument("--clean", action="store_true")
    args = parser.parse_args()
    names = GROUPS[args.group]
    if args.clean:
        for name, kind in list_takes(names):
            clean = analyse_clean(name, kind)
            print(f"{name:18} {kind:14}", None if clean is None else sorted(list_warnings(clean), key=str))
        return
    rows = run_all(draw_runs(names, args.runs, args.seed), args.out)
    for by in ("kind", "set"):
        print_table(rows, by)


if __name__ == "__main__":
    main()
