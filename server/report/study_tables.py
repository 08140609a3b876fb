"""Tables over many trials: strides, trials, and failures with their messages.

Used by `sagittal study` for a folder and by the service for selected visits.
"""

from __future__ import annotations

import csv
import io
import json
import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any, Final

from sagittal.core.errors import SagittalError
from sagittal.core.events.result import MANUAL
from sagittal.server.report.files.columns import write_csv
from sagittal.server.report.words.estimator import list_estimated_angles

PROVENANCE: Final = "provenance.json"
FAILURES: Final = "failures.csv"
_LIBRARIES: Final = ("numpy", "scipy", "numba", "pyarrow")


@dataclass(frozen=True, eq=False)
class StudyTake:
    """A trial of a study.

    Parameters
    ----------
    name : unique in the study. labels : further attributes, also added to every row of its strides.
    files : their number. sha256 : of each by name.
    error : why there is no result, None if there is one.
    read_analysis : its analysis.json. read_strides : its strides.csv, None without strides.
    """

    name: str
    labels: Mapping[str, object]
    files: int
    sha256: Mapping[str, str]
    error: SagittalError | None
    read_analysis: Callable[[], Mapping[str, Any]]
    read_strides: Callable[[], bytes | None]


@dataclass(frozen=True, eq=False)
class StudyTables:
    """Files by name, the number of strides, and the number of failed trials."""

    files: Mapping[str, bytes]
    strides: int
    failed: int


def write_study(takes: Sequence[StudyTake], about: Mapping[str, object]) -> StudyTables:
    """Write strides and trials as CSV and Parquet, failures as CSV, and provenance as JSON.

    Parameters
    ----------
    about : content of provenance.json in addition to versions and trials.
    """
    strides = [row for take in takes for row in _list_strides(take)]
    failed = [
        {"take": t.name, "code": t.error.code, "message": t.error.message}
        for t in takes
        if t.error is not None
    ]
    provenance = {
        "python": platform.python_version(),
        "libraries": {name: version(name) for name in _LIBRARIES},
        **about,
        "takes": {
            t.name: {"sha256": dict(t.sha256), "error": None if t.error is None else t.error.code}
            for t in takes
        },
    }
    files = {
        **_write_table("strides", strides),
        **_write_table("takes", [_summarise(take) for take in takes]),
        FAILURES: _write_rows(failed, ("take", "code", "message")),
        PROVENANCE: json.dumps(provenance, ensure_ascii=False, indent=1).encode(),
    }
    return StudyTables(files, len(strides), len(failed))


def _list_strides(take: StudyTake) -> Iterator[dict[str, object]]:
    written = None if take.error is not None else take.read_strides()
    if written is None:
        return
    modelled = _list_estimated(take.read_analysis())
    for row in csv.DictReader(io.StringIO(written.decode())):
        own = [a for a in modelled if a.endswith(f"_{row['side'][0]}")]
        values = {name: _value(cell) for name, cell in row.items()}
        if row.get("excluded_reason", "").startswith(MANUAL):
            values["excluded_reason"] = MANUAL.removesuffix(":")  # free text may name a patient
        yield {"take": take.name, **take.labels, **values, "estimated_angles": " ".join(own) or None}


def _summarise(take: StudyTake) -> dict[str, object]:
    """One row of the table of trials: labels, quality, and the mean of every parameter."""
    code = None if take.error is None else take.error.code
    row: dict[str, object] = {"take": take.name, **take.labels, "files": take.files, "error": code}
    if code is not None:
        return row
    analysis = take.read_analysis()
    estimator = (analysis["estimator"] or {}).get("name")
    row |= {
        "quality": analysis["quality"]["level"],
        "estimator": estimator,
        "warnings": len(analysis["warnings"]),
    }
    row["estimated_angles"] = " ".join(_list_estimated(analysis)) or None
    for p in analysis["parameters"]:
        row["_".join(part for part in (p["name"], p["side"]) if part)] = p["mean"]
    return row


def _list_estimated(analysis: Mapping[str, Any]) -> list[str]:
    """Angles with their side that are estimated by a leg model rather than measured by two sensors."""
    return sorted(list_estimated_angles(analysis["estimator"]))


def _value(cell: str) -> object:
    if cell == "":
        return None
    try:
        return float(cell)
    except ValueError:
        return cell


def _write_table(stem: str, rows: Sequence[Mapping[str, object]]) -> dict[str, bytes]:
    """A table as CSV and Parquet; columns missing in some rows are null there."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    names = tuple(dict.fromkeys(name for row in rows for name in row))
    columns = {}
    for name in names:
        values: list[Any] = [row.get(name) for row in rows]
        if any(isinstance(v, str) for v in values):
            values = [None if v is None else str(v) for v in values]
        columns[name] = pa.array(values)
    out = io.BytesIO()
    pq.write_table(pa.table(columns), out, compression="zstd")
    return {f"{stem}.csv": _write_rows(rows, names), f"{stem}.parquet": out.getvalue()}


def _write_rows(rows: Sequence[Mapping[str, object]], names: Sequence[str]) -> bytes:
    return write_csv(names, ([row.get(name) for name in names] for row in rows))
