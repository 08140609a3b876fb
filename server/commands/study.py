"""`sagittal study`: every recording of a folder analysed, one table of all strides and one of all takes."""

from __future__ import annotations

import csv
import datetime as dt
import hashlib
import io
import json
import os
import platform
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from server.processes.compiling import OFFLINE, compile_filters_once
from server.services.provenance import CODE_VERSION
from server.storage import fs

if TYPE_CHECKING:
    from core.formats.takes import FoundTake

TAKES: Final = "takes"
PROVENANCE: Final = "provenance.json"
KEPT: Final = ("analysis.json", "strides.csv")
"""Result files of a take that the tables are made of."""
_LIBRARIES: Final = ("numpy", "scipy", "numba", "pyarrow")
_STATE: Final = "state.json"


def study(folder: Path, out: Path, config: Path | None = None, jobs: int | None = None) -> int:
    """Analyse every take of a folder; what is done already, with the same files and settings, is kept.

    Parameters
    ----------
    config : JSON file with overrides of parameters by stage. jobs : takes at a time, None = one a processor.

    Returns
    -------
    0 when at least one take was analysed, 1 when none was or there is none.
    """
    from core.errors import SagittalError
    from core.formats.takes import find_takes
    from server.commands.analyse import read_overrides

    started = dt.datetime.now(dt.UTC)
    try:
        chosen = read_overrides(config, "auto")
        takes = find_takes(folder) if folder.is_dir() else []
    except SagittalError as error:
        sys.stderr.write(f"No study ({error.code}): {error.message}\n")
        return 1
    if not takes:
        sys.stderr.write(f"No recording was found in {folder}; give a folder with recordings.\n")
        return 1
    fs.make_folder(out / TAKES)
    states = _analyse_all(takes, out, chosen, jobs or os.cpu_count() or 1)
    rows = _write_tables(takes, states, out)
    provenance = {
        "code_version": CODE_VERSION,
        "python": platform.python_version(),
        "libraries": {name: version(name) for name in _LIBRARIES},
        "folder": str(folder.resolve()),
        "config": chosen,
        "started_at": started.isoformat(timespec="seconds"),
        "finished_at": dt.datetime.now(dt.UTC).isoformat(timespec="seconds"),
        "takes": {
            t.name: {"sha256": states[t.name]["sha256"], "error": states[t.name]["code"]} for t in takes
        },
    }
    fs.write_file(out / PROVENANCE, json.dumps(provenance, ensure_ascii=False, indent=1).encode())
    failed = sum(s["code"] is not None for s in states.values())
    sys.stdout.write(
        f"{len(takes) - failed} of {len(takes)} takes analysed, {rows} strides; "
        f"{failed} failed (failures.csv). Results in {out}\n"
    )
    return 0 if failed < len(takes) else 1


def _analyse_all(
    takes: Sequence[FoundTake], out: Path, config: Mapping[str, Any], jobs: int
) -> dict[str, dict[str, Any]]:
    """State of every take by its name; those that are not done yet are analysed, several at a time."""
    states: dict[str, dict[str, Any]] = {}
    waiting: list[tuple[FoundTake, dict[str, str]]] = []
    for take in takes:
        sha256 = _digests(take)
        state = _read_state(_folder_of(out, take))
        if state is not None and (state["sha256"], state["config"], state["code_version"]) == (
            sha256,
            config,
            CODE_VERSION,
        ):
            states[take.name] = state
        else:
            waiting.append((take, sha256))
    if not waiting:
        return states
    compile_filters_once(OFFLINE)
    with ProcessPoolExecutor(min(jobs, len(waiting)), mp_context=get_context("spawn")) as pool:
        running: dict[Future[dict[str, Any]], str] = {
            pool.submit(analyse_take, take.paths, _folder_of(out, take), dict(config), sha256): take.name
            for take, sha256 in waiting
        }
        for done in as_completed(running):
            name = running[done]
            error = done.exception()
            # the others go on, whatever happened in the process of this one
            states[name] = done.result() if error is None else _died(error)
            code = states[name]["code"]
            sys.stderr.write(f"{len(states)}/{len(takes)} {name}{f': {code}' if code else ''}\n")
            sys.stderr.flush()
    return states


def _died(error: BaseException) -> dict[str, Any]:
    why = f"The analysis ended unexpectedly ({type(error).__name__}: {error}); run again, or tell the makers."
    return {"sha256": {}, "config": {}, "code_version": CODE_VERSION, "code": "died", "message": why}


def analyse_take(
    paths: Sequence[Path], folder: Path, config: dict[str, Any], sha256: dict[str, str]
) -> dict[str, Any]:
    """Analyse one take in a process of its own; its state last, so that what was cut off is done again."""
    from core.errors import SagittalError
    from core.formats.source import SourceFile
    from server.services import analysing

    state: dict[str, Any] = {"sha256": sha256, "config": config, "code_version": CODE_VERSION}
    state |= {"code": None, "message": None}
    fs.make_folder(folder)
    try:
        files = [SourceFile.of_path(path) for path in paths]
        found = analysing.run(files, None, config, lambda stage, share: None)
        for name in KEPT:
            if name in found:
                fs.write_file(folder / name, found[name])
    except SagittalError as error:
        state |= {"code": error.code, "message": error.message}
    fs.write_file(folder / _STATE, json.dumps(state, ensure_ascii=False).encode())
    return state


def _digests(take: FoundTake) -> dict[str, str]:
    from core.formats.source import SourceFile, digest_file

    return {path.name: digest_file(SourceFile.of_path(path)) for path in take.paths}


def _folder_of(out: Path, take: FoundTake) -> Path:
    return out / TAKES / hashlib.sha256(take.name.encode()).hexdigest()[:16]


def _read_state(folder: Path) -> dict[str, Any] | None:
    try:
        state = json.loads((folder / _STATE).read_bytes())
    except (OSError, ValueError):
        return None
    return state if isinstance(state, dict) and {"sha256", "config", "code_version"} <= state.keys() else None


def _write_tables(takes: Sequence[FoundTake], states: Mapping[str, Mapping[str, Any]], out: Path) -> int:
    """strides and takes as CSV and Parquet, failures as CSV; returns the number of strides."""
    strides = [row for take in takes for row in _strides(take, states[take.name], out)]
    _write(out / "strides", strides)
    _write(out / "takes", [_summary(take, states[take.name], out) for take in takes])
    failed = [
        {"take": t.name, "code": states[t.name]["code"], "message": states[t.name]["message"]}
        for t in takes
        if states[t.name]["code"]
    ]
    _write_csv(out / "failures.csv", failed, ("take", "code", "message"))
    return len(strides)


def _labels(take: FoundTake) -> dict[str, str]:
    return {"take": take.name, **take.labels}


def _strides(take: FoundTake, state: Mapping[str, Any], out: Path) -> Iterator[dict[str, object]]:
    path = _folder_of(out, take) / "strides.csv"
    if state["code"] is None and path.exists():
        modelled = _list_estimated(_read_analysis(take, out))
        for row in csv.DictReader(io.StringIO(path.read_text("utf-8"))):
            own = [a for a in modelled if a.endswith(f"_{row['side'][0]}")]
            values = {name: _value(cell) for name, cell in row.items()}
            yield {**_labels(take), **values, "estimated_angles": " ".join(own) or None}


def _summary(take: FoundTake, state: Mapping[str, Any], out: Path) -> dict[str, object]:
    """One row of the table of takes: what it is, how it went, the mean of every parameter."""
    row: dict[str, object] = {**_labels(take), "files": len(take.paths), "error": state["code"]}
    if state["code"] is not None:
        return row
    found = _read_analysis(take, out)
    estimator = (found["estimator"] or {}).get("name")
    row |= {"quality": found["quality"]["level"], "estimator": estimator, "warnings": len(found["warnings"])}
    row["estimated_angles"] = " ".join(_list_estimated(found)) or None
    for p in found["parameters"]:
        row["_".join(part for part in (p["name"], p["side"]) if part)] = p["mean"]
    return row


def _read_analysis(take: FoundTake, out: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((_folder_of(out, take) / "analysis.json").read_bytes())
    return found


def _list_estimated(found: Mapping[str, Any]) -> list[str]:
    """Angles with their side that a model of the leg gives, and no two sensors measure."""
    from server.report.estimator import list_estimated_angles

    return sorted(list_estimated_angles(found["estimator"]))


def _value(cell: str) -> object:
    if cell == "":
        return None
    try:
        return float(cell)
    except ValueError:
        return cell


def _write(stem: Path, rows: Sequence[Mapping[str, object]]) -> None:
    """The same table as CSV and as Parquet; a column that some rows lack is null there."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    names = tuple(dict.fromkeys(name for row in rows for name in row))
    _write_csv(stem.with_suffix(".csv"), rows, names)
    columns = {}
    for name in names:
        values: list[Any] = [row.get(name) for row in rows]
        if any(isinstance(v, str) for v in values):
            values = [None if v is None else str(v) for v in values]
        columns[name] = pa.array(values)
    out = io.BytesIO()
    pq.write_table(pa.table(columns), out, compression="zstd")
    fs.write_file(stem.with_suffix(".parquet"), out.getvalue())


def _write_csv(path: Path, rows: Sequence[Mapping[str, object]], names: Sequence[str]) -> None:
    from server.report.columns import write_csv

    fs.write_file(path, write_csv(names, ([row.get(name) for name in names] for row in rows)))
