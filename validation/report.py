"""Writes validation/report.md and docs/reference/accuracy.md from the figures of a validation."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

from tests.data import ROOT
from tests.helpers.pairs import plain_python
from validation.figures import (
    GOALS,
    GOALS_HEADER,
    IN_SHORT,
    KEY_FIGURES,
    REPORT,
    find_differences,
    format_line,
    format_table,
    read_sections,
)

ACCURACY: Final = ROOT / "docs" / "reference" / "accuracy.md"

RUN: Final = "Run"
DIFFERENCES: Final = "Differences from the previous report"
GENERATED: Final = (RUN, DIFFERENCES)

HEAD: Final = """# Validation report

Written by `python -m validation --write`; do not edit. Accuracy on real recordings (`SAGITTAL_DATA`) and on
simulated people, speed and memory, faults. Limits are asserted by the tests; a section that the last run did
not measure keeps its figures of an earlier one."""

ACCURACY_HEAD: Final = """# Accuracy

Key figures of the last [validation report](../validation/report.md), which has every table, its limits, the
machine and the versions. Written by `python -m validation --write`; do not edit. They are measured again by
`python -m validation accuracy` ([contributing.md](contributing.md), "Validate a release")."""

PACKAGES: Final = ("sagittal", "numpy", "scipy", "numba", "pyarrow", "fastapi", "sqlalchemy", "viser")


@dataclass
class UnitResult:
    """Outcome of one unit of the validation.

    Parameters
    ----------
    unit : its name. outcome : "passed", "failed" or "skipped". summary : pytest's closing line.
    seconds : wall time. code : digest of the code it ran on. at : start, ISO 8601 UTC.
    whole : whether all cases ran.
    figures : recorded lines, as `validation.figures` stores them.
    """

    unit: str
    outcome: str
    summary: str
    seconds: float
    code: str
    at: str
    whole: bool
    figures: list[dict[str, str]] = field(default_factory=list)

    @classmethod
    def read(cls, path: Path) -> UnitResult | None:
        """Result of an earlier run; None if there is none."""
        if not path.exists():
            return None
        content: dict[str, Any] = json.loads(path.read_text("utf-8"))
        return cls(**content)


def merge_figures(sections: Mapping[str, str], figures: Iterable[Mapping[str, str]]) -> dict[str, str]:
    """Sections with those measured in place of the old ones; rows replace the row of the same first cell."""
    merged = dict(sections)
    for line in figures:
        if line["kind"] == "section":
            merged[line["section"]] = line["text"]
        elif line["kind"] == "row":
            merged[line["section"]] = _put_row(merged.get(line["section"], ""), line["section"], line["text"])
    return merged


def _put_row(text: str, section: str, new: str) -> str:
    row = new.splitlines()[-1]
    header = format_line(GOALS_HEADER) if section == GOALS else new.splitlines()[0]
    lines = [line for line in text.splitlines() if line.startswith("|")][2:]
    strip = "\n".join(line for line in text.splitlines() if not line.startswith("|")).strip()
    rows = {line.split(" | ")[0]: line for line in lines} | {row.split(" | ")[0]: row}
    if section == IN_SHORT:
        rows = {key: rows[key] for figure in KEY_FIGURES if (key := f"| {figure}") in rows}
    rule = format_line(["---"] * (header.count(" | ") + 1))
    return "\n".join((header, rule, *rows.values())) + (f"\n\n{strip}" if strip else "")


def list_differences(old: Mapping[str, str], new: Mapping[str, str]) -> str:
    """Changed lines of every section that both reports have, as a Markdown diff; speed is left out."""
    blocks = []
    for name in sorted(set(new) - set(GENERATED)):
        if name.startswith("Speed: "):
            continue
        if name not in old:
            blocks.append(f"New section: {name}.")
        elif differences := find_differences(old[name], new[name]):
            blocks.append("\n".join((f"{name}:", "", "```diff", *differences, "```")))
    return "\n\n".join(blocks) or "None."


def describe_run(results: Sequence[UnitResult]) -> str:
    """When, on which machine and with which versions the figures were measured, and what failed."""
    rows = [
        ("date (UTC)", datetime.now(UTC).strftime("%Y-%m-%d %H:%M")),
        ("commit", _git("describe", "--always", "--dirty", "--tags")),
        ("machine", f"{platform.machine()}, {os.cpu_count()} processors, {_memory_gb():.0f} GB"),
        ("100,000 steps of plain Python", f"{_plain_python_ms():.0f} ms"),
        ("Python", sys.version.split()[0]),
        *((name, _version(name)) for name in PACKAGES),
        ("units", f"{len(results)}, {sum(r.outcome == 'failed' for r in results)} failed"),
        ("time", f"{sum(r.seconds for r in results) / 60.0:.0f} min"),
    ]
    failed = [f"- `{r.unit}`: {r.summary}" for r in results if r.outcome == "failed"]
    return format_table(("", ""), rows) + ("\n\nFailed:\n\n" + "\n".join(failed) if failed else "")


def write_report(results: Sequence[UnitResult], path: Path = REPORT, accuracy: Path = ACCURACY) -> None:
    """Write the report with these results, and the key figures of docs/reference/accuracy.md."""
    old = read_sections(path)
    new = merge_figures(old, (line for r in results for line in r.figures))
    new = {name: text for name, text in new.items() if name not in GENERATED}
    generated = {RUN: describe_run(results), DIFFERENCES: list_differences(old, new)}
    order = sorted(new, key=lambda name: (name != IN_SHORT, name.startswith("Speed: "), name))
    sections = [*generated.items(), *((name, new[name]) for name in order)]
    path.write_text(_join(HEAD, sections), encoding="utf-8")
    accuracy.write_text(_join(ACCURACY_HEAD, [(IN_SHORT, new.get(IN_SHORT, ""))]), encoding="utf-8")


def _join(head: str, sections: Iterable[tuple[str, str]]) -> str:
    return "\n\n".join((head, *(f"## {name}\n\n{text}" for name, text in sections))) + "\n"


def _git(*arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "unknown"


def _memory_gb() -> float:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9


def _plain_python_ms() -> float:
    times = []
    for _ in range(7):
        start = time.process_time()
        plain_python()
        times.append(time.process_time() - start)
    return 1e3 * sorted(times)[3]


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
