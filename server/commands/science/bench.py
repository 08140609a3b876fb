"""`sagittal bench fusion`: list published orientation filters, or score them on reference recordings."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from sagittal.server.storage import fs

if TYPE_CHECKING:
    from sagittal.core.fusion.algorithms.benchmark import OrientationScore, ReferenceTrial
    from sagittal.core.fusion.algorithms.choice import OwnFilter
    from sagittal.core.fusion.algorithms.listed import Algorithm

HEADER = (
    "algorithm", "recording", "total_deg", "heading_deg", "inclination_deg", "total_with_bias_deg",
    "heading_with_bias_deg", "inclination_with_bias_deg", "reason",
)  # fmt: skip

Row = tuple[str, str, tuple[float | None, ...], str]
"""Algorithm, recording, three errors in ° without and three with the gyroscope's static bias, reason."""


def bench(
    what: Literal["fusion"],
    folder: Path | None = None,
    /,
    *,
    show_list: Annotated[bool, Parameter(name="--list")] = False,
    out: Annotated[Path | None, Parameter(metavar="CSV")] = None,
    every: bool = False,
) -> int:
    """List the algorithms, or score each on every recording of a folder; 1 = no recording, 2 = no folder.

    Parameters
    ----------
    what
        fusion: orientation filters of one sensor
    folder
        recordings (docs/science/filters.md)
    show_list
        list algorithms with their sources
    out
        write all scores to a file
    every
        print each recording instead of the mean
    """
    if show_list:
        sys.stdout.write(_table(_list_algorithms()))
        return 0
    if folder is None or not folder.is_dir():
        sys.stderr.write(f"sagittal bench {what} needs a folder of recordings with reference, or --list.\n")
        return 2
    trials = _read_trials(folder)
    if not trials:
        sys.stderr.write(
            f"No recording with reference in {folder} (docs/science/filters.md says the format).\n"
        )
        return 1
    rows = _score_all(trials)
    if out is not None:
        _write(out, rows)
    _print_scores(rows, every)
    return 0


def _read_trials(folder: Path) -> list[ReferenceTrial]:
    """Read the recordings of a folder; errors are printed for unreadable ones."""
    from sagittal.core.errors import FormatError
    from sagittal.core.fusion.algorithms.benchmark import read_trial

    trials = []
    for path in sorted(folder.glob("*.npz")):
        try:
            trials.append(read_trial(path.stem, path.read_bytes()))
        except FormatError as error:
            sys.stderr.write(f"{error}\n")
    return trials


def _score_all(trials: Sequence[ReferenceTrial]) -> list[Row]:
    from sagittal.core.fusion.algorithms.choice import OWN
    from sagittal.core.fusion.algorithms.listed import ALGORITHMS

    rows = [_score(algorithm, trial) for algorithm in ALGORITHMS for trial in trials]
    return rows + [_score_own(own, trial) for own in OWN for trial in trials]


def _print_scores(rows: Sequence[Row], every: bool) -> None:
    from sagittal.core.fusion.algorithms.choice import LABELS

    table = rows if every else [_average(rows, x) for x in LABELS.values()]
    sys.stdout.write(
        _table(
            [("algorithm", "recording", "total °", "inclination °", "with bias °", ""), *map(_words, table)]
        )
    )
    sys.stdout.write(
        "RMS error over the moving phase; the gyroscope's bias at rest taken off, and left in.\n"
    )
    sys.stdout.flush()


def _list_algorithms() -> list[Sequence[str]]:
    from sagittal.core.fusion.algorithms.listed import ALGORITHMS, ENGINES, GRADES

    rows: list[Sequence[str]] = [("name", "algorithm", "engine", "grade", "magnetometer", "source")]
    for a in ALGORITHMS:
        grade = f"{a.grade}, {GRADES[a.grade]}"
        rows.append((a.name, a.shown, f"{a.engine} {ENGINES[a.engine]}", grade, a.magnetometer, a.paper.line))
    return rows


def _score(algorithm: Algorithm, trial: ReferenceTrial) -> Row:
    from sagittal.core.errors import SagittalError
    from sagittal.core.fusion.algorithms.benchmark import run_trial, score_orientation

    scores: list[float | None] = []
    try:
        for with_bias in (False, True):
            q = run_trial(algorithm.name, trial, with_bias=with_bias)
            scores += _degrees(score_orientation(q, trial), algorithm.magnetometer != "unused")
    except SagittalError as error:
        return algorithm.shown, trial.name, (None,) * 6, error.message
    reason = "" if algorithm.magnetometer != "unused" else "no magnetometer: its heading is arbitrary"
    return algorithm.shown, trial.name, tuple(scores), reason


def _score_own(own: OwnFilter, trial: ReferenceTrial) -> Row:
    from sagittal.core.errors import SagittalError
    from sagittal.core.fusion.algorithms.benchmark import run_own, score_orientation

    try:
        scores = _degrees(score_orientation(run_own(trial, both_ways=own.both_ways), trial), has_heading=True)
    except SagittalError as error:
        return own.label, trial.name, (None,) * 6, error.message
    return own.label, trial.name, (*scores, *scores), "finds the bias itself"


def _degrees(score: OrientationScore, has_heading: bool) -> list[float | None]:
    total, heading = (score.total, score.heading) if has_heading else (math.nan, math.nan)
    values = (math.degrees(x) for x in (total, heading, score.inclination))
    return [None if math.isnan(x) else x for x in values]


def _average(rows: Sequence[Row], label: str) -> Row:
    mine = [row for row in rows if row[0] == label]
    means = []
    for values in zip(*(row[2] for row in mine), strict=True):
        finite = [v for v in values if v is not None]
        means.append(sum(finite) / len(finite) if finite else None)
    reason = next((row[3] for row in mine if row[3]), "")
    scored = sum(any(v is not None for v in row[2]) for row in mine)
    return label, f"mean of {scored} of {len(mine)}", tuple(means), reason


def _words(row: Row) -> Sequence[str]:
    def say(value: float | None) -> str:
        return "–" if value is None else f"{value:.2f}"

    label, recording, values, reason = row
    return label, recording, say(values[0]), say(values[2]), f"{say(values[3])} / {say(values[5])}", reason


def _table(rows: Sequence[Sequence[str]]) -> str:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = ("  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in rows)
    return "\n".join(lines) + "\n"


def _write(out: Path, rows: Sequence[Row]) -> None:
    from sagittal.server.report.files.columns import write_csv

    fs.make_folder(out.parent)
    fs.write_file(out, write_csv(HEADER, [(a, b, *values, reason) for a, b, values, reason in rows]))
