"""`sagittal study`: analyse every recording of a folder into one table of strides and one of trials."""

from __future__ import annotations

import datetime as dt
import hashlib
import json
import os
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from sagittal.core.errors import SagittalError
from sagittal.server.commands.options import Whole
from sagittal.server.processes.compiling import OFFLINE, compile_filters_once
from sagittal.server.provenance import CODE_VERSION
from sagittal.server.storage import fs

if TYPE_CHECKING:
    from sagittal.core.formats.takes import FoundTake
    from sagittal.server.report.study_tables import StudyTake

TAKES: Final = "takes"
KEPT: Final = ("analysis.json", "strides.csv")
"""Result files of a trial required for the tables."""
_STATE: Final = "state.json"


def study(folder: Path, /, *, out: Path, config: Path | None = None, jobs: Whole | None = None) -> int:
    """Analyse every trial of a folder; results with the same files and settings are reused.

    Parameters
    ----------
    folder
        recordings in any layout, including BIDS
    out
        folder for the tables; running again resumes
    config
        JSON: parameters by stage, for every trial
    jobs
        parallel trials (default: one per processor)

    Returns
    -------
    0 if at least one trial was analysed, otherwise 1.
    """
    from sagittal.core.formats.takes import find_takes
    from sagittal.server.commands.analyse import read_overrides
    from sagittal.server.report.study_tables import write_study

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
    tables = write_study(
        [_open_take(take, states[take.name], out) for take in takes],
        {
            "code_version": CODE_VERSION,
            "folder": str(folder.resolve()),
            "config": chosen,
            "started_at": started.isoformat(timespec="seconds"),
            "finished_at": dt.datetime.now(dt.UTC).isoformat(timespec="seconds"),
        },
    )
    for name, content in tables.files.items():
        fs.write_file(out / name, content)
    rows, failed = tables.strides, tables.failed
    sys.stdout.write(
        f"{len(takes) - failed} of {len(takes)} takes analysed, {rows} strides; "
        f"{failed} failed (failures.csv). Results in {out}\n"
    )
    return 0 if failed < len(takes) else 1


def _analyse_all(
    takes: Sequence[FoundTake], out: Path, config: Mapping[str, Any], jobs: int
) -> dict[str, dict[str, Any]]:
    """State of every trial by name; pending ones are analysed in parallel."""
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
            # the other trials continue, whatever happened in this process
            states[name] = done.result() if error is None else _died(error)
            code = states[name]["code"]
            sys.stderr.write(f"{len(states)}/{len(takes)} {name}{f': {code}' if code else ''}\n")
            sys.stderr.flush()
    return states


def _died(error: BaseException) -> dict[str, Any]:
    message = (
        f"The analysis ended unexpectedly ({type(error).__name__}: {error}); run again, or tell the makers."
    )
    return {"sha256": {}, "config": {}, "code_version": CODE_VERSION, "code": "died", "message": message}


def analyse_take(
    paths: Sequence[Path], folder: Path, config: dict[str, Any], sha256: dict[str, str]
) -> dict[str, Any]:
    """Analyse one trial in its own process; its state is written last, so interrupted ones are repeated."""
    from sagittal.core.formats.source import SourceFile
    from sagittal.server.results import analysing

    state: dict[str, Any] = {"sha256": sha256, "config": config, "code_version": CODE_VERSION}
    state |= {"code": None, "message": None}
    fs.make_folder(folder)
    try:
        files = [SourceFile.of_path(path) for path in paths]
        result_files = analysing.run(files, None, config, lambda stage, share: None)
        for name in KEPT:
            if name in result_files:
                fs.write_file(folder / name, result_files[name])
    except SagittalError as error:
        state |= {"code": error.code, "message": error.message}
    fs.write_file(folder / _STATE, json.dumps(state, ensure_ascii=False).encode())
    return state


def _digests(take: FoundTake) -> dict[str, str]:
    from sagittal.core.formats.source import SourceFile, digest_file

    return {path.name: digest_file(SourceFile.of_path(path)) for path in take.paths}


def _folder_of(out: Path, take: FoundTake) -> Path:
    return out / TAKES / hashlib.sha256(take.name.encode()).hexdigest()[:16]


def _read_state(folder: Path) -> dict[str, Any] | None:
    try:
        state = json.loads((folder / _STATE).read_bytes())
    except (OSError, ValueError):
        return None
    return state if isinstance(state, dict) and {"sha256", "config", "code_version"} <= state.keys() else None


def _open_take(take: FoundTake, state: Mapping[str, Any], out: Path) -> StudyTake:
    from sagittal.server.report.study_tables import StudyTake

    folder = _folder_of(out, take)
    strides = folder / "strides.csv"
    return StudyTake(
        take.name,
        take.labels,
        len(take.paths),
        state["sha256"],
        None if state["code"] is None else SagittalError(state["code"], state["message"]),
        lambda: json.loads((folder / "analysis.json").read_bytes()),
        lambda: strides.read_bytes() if strides.exists() else None,
    )
