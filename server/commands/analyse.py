"""`sagittal analyse`: recording files in, result files out, using the same code as the service."""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any, Self

from sagittal.core.errors import InputError, SagittalError
from sagittal.core.formats.json_tree import read_json
from sagittal.server.commands.options import Manifest, Take
from sagittal.server.processes.compiling import OFFLINE, compile_filters_once, is_compiling
from sagittal.server.report.files import activity_files
from sagittal.server.report.words.estimator import estimator_view
from sagittal.server.storage import fs
from sagittal.server.storage.compile_cache import has_compiled_filters


def analyse(
    paths: Take,
    /,
    *,
    out: Path,
    manifest: Manifest = None,
    estimator: str = "auto",
    config: Path | None = None,
) -> int:
    """Analyse files, folders or zips as one recording and write the results into `out`.

    Parameters
    ----------
    out
        folder for the results
    estimator
        pose estimator; auto = the best for the available sensors (see docs/reference/estimators.md)
    config
        JSON: parameters by stage, {"poses": {"least_valid": 0.7}}

    Returns
    -------
    0 if at least one parameter was computed, 1 if nothing could be analysed.
    """
    from sagittal.core.formats import list_source_files, read_named_file
    from sagittal.server.results import analysing

    try:
        overrides = read_overrides(config, estimator)
        out.mkdir(parents=True, exist_ok=True)  # fail before minutes of work
        sources = list(list_source_files(paths))
        declared = read_named_file(manifest) if manifest else None
        with _ProgressBar() as bar:
            if is_compiling() or not has_compiled_filters():
                bar.stage("compiling, once", 0.0)
            compile_filters_once(OFFLINE)
            files = analysing.run(sources, declared, overrides, bar.stage)
    except SagittalError as error:
        sys.stderr.write(f"Nothing analysable ({error.code}): {error.message}\n")
        if error.code == "no_mapping":
            sys.stderr.write("Here --manifest FILE says it (docs/reference/formats.md).\n")
        return 1
    for name, content in files.items():
        fs.write_file(out / name, content)
    result = json.loads(files["analysis.json"])
    print_summary(result, out)
    if activity_files.NAME in files:
        print_day(json.loads(files[activity_files.NAME]))
        return 0
    return 0 if any(p["mean"] is not None for p in result["parameters"]) else 1


def read_overrides(path: Path | None, estimator: str) -> dict[str, Any]:
    """Read configuration overrides from a file and add the estimator given on the command line.

    Raises
    ------
    InputError `config_unreadable`.
    """
    try:
        chosen = read_json(path.read_bytes()) if path else {}
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError("config_unreadable", f"{path} cannot be read as JSON: {reason}.") from error
    if not isinstance(chosen, dict) or not isinstance(chosen.get("poses", {}), dict):
        raise InputError("config_unreadable", f'{path} is not of the form {{"stage": {{"name": value}}}}.')
    if estimator != "auto":
        chosen["poses"] = {**chosen.get("poses", {}), "estimator": estimator}
    return chosen


def print_summary(result: dict[str, Any], out: Path) -> None:
    """Print parameters as a table, the estimator, the data quality and warnings to stdout."""
    lines = [f"{'parameter':<36}{'side':<8}{'n':>4}{'mean':>10}{'sd':>9}  unit"]
    for p in result["parameters"]:
        if p["mean"] is None:
            lines.append(f"{p['name']:<36}{p['side'] or '':<8}{p['n']:>4}{'–':>10}{'':>9}  {p['reason']}")
        else:
            sd = "" if p["sd"] is None else f"{p['sd']:.3f}"
            lines.append(
                f"{p['name']:<36}{p['side'] or '':<8}{p['n']:>4}{p['mean']:>10.3f}{sd:>9}  {p['unit']}"
            )
    view = estimator_view(result["estimator"])
    if view is not None:
        lines.append(f"Poses by {view.name}, {view.sensors} sensors: {view.reduced or view.verdict}.")
    lines += [f"{w['code']}: {w['message']}" for w in result["warnings"]]
    lines.append(f"Results in {out}")
    sys.stdout.write("\n".join(lines) + "\n")
    sys.stdout.flush()


def print_day(found: dict[str, Any]) -> None:
    """Print a summary of daily life to stdout: durations, steps and transitions."""
    times = [f"{kind} {minutes:.0f} min" for kind, minutes in found["minutes"].items() if minutes >= 0.5]
    counts = Counter(t["kind"] for t in found["transitions"])
    changes = [f"{kind} {number}" for kind, number in sorted(counts.items())]
    lines = [
        f"Worn on the {found['segment']} for {found['duration_s'] / 3600:.1f} h: {', '.join(times)}.",
        f"{found['steps']} steps in {len(found['bouts'])} bouts; {', '.join(changes) or 'no transitions'}.",
        f"{found['sub_threshold']} candidates lack nothing but the lean.",
    ]
    sys.stdout.write("\n".join(lines) + "\n")


class _ProgressBar:
    """Progress on stderr: a bar on a terminal, one line per stage elsewhere."""

    def __enter__(self) -> Self:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        console = Console(stderr=True)
        self._progress = Progress(
            TextColumn("{task.description:<14}"), BarColumn(), TimeElapsedColumn(), console=console
        )
        self._plain = not console.is_terminal
        self._task = self._progress.add_task("reading", total=1.0)
        if not self._plain:
            self._progress.start()
        return self

    def stage(self, name: str, share: float) -> None:
        """Show the current stage."""
        if self._plain:
            sys.stderr.write(f"{share:4.0%} {name}\n")
            sys.stderr.flush()
        self._progress.update(self._task, description=name, completed=share)

    def __exit__(self, *_: object) -> None:
        if not self._plain:
            self._progress.stop()
