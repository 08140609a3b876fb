"""`sagittal tune`: fit the gains of one filter to reference recordings, using the service's code."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sagittal.core.fusion.algorithms.schemes import Scheme
from sagittal.server.commands.options import Seed, Whole
from sagittal.server.storage import fs


def tune(
    folder: Path,
    /,
    *,
    algorithm: str,
    validation: Annotated[tuple[str, ...], Parameter(name="--validate", metavar="NAME ...")],
    out: Annotated[Path, Parameter(metavar="JSON")] = Path("tuned.json"),
    resume: Annotated[Path | None, Parameter(metavar="FILE")] = None,
    scheme: Scheme | None = None,
    magnetometer: Annotated[bool | None, Parameter(negative="--no-magnetometer")] = None,
    seed: Seed = 0,
    particles: Whole | None = None,
    iterations: Whole | None = None,
    rounds: Whole | None = None,
    random_rounds: Whole | None = None,
) -> int:
    """Fit gains to the trials of a folder and write them to `out`; checkpoints are written alongside.

    Parameters
    ----------
    folder
        recordings (docs/science/filters.md)
    algorithm
        name from `sagittal bench fusion --list`
    validation
        names of validation recordings, without .npz
    out
        default tuned.json
    resume
        continue from the checkpoint of a stopped run
    scheme
        adaptation of gains to the motion (default: the algorithm's)
    magnetometer
        default: if supported
    particles
        of the swarm (default: the thesis')
    iterations
        of the swarm (default: the thesis')
    rounds
        of the swarm (default: the thesis')
    random_rounds
        of the swarm (default: the thesis')

    Returns
    -------
    0 = done, improved or not; 1 = not possible, 130 = interrupted.
    """
    from sagittal.core.errors import SagittalError
    from sagittal.core.formats import list_source_files, read_named_file
    from sagittal.server.results.tunings import TuningOrder, prepare, search

    checkpoint = out.with_name(f"{out.name}.checkpoint")

    def keep(content: bytes, share: float, message: str) -> None:
        fs.write_file(checkpoint, content)
        _say_progress(share, message)

    try:
        order = TuningOrder(
            algorithm, validation, scheme, magnetometer, seed, particles, iterations, rounds, random_rounds
        )
        tuner = prepare(list(list_source_files([folder])), order)
        swarm = tuner.read_checkpoint(read_named_file(resume)) if resume else None
        fs.make_folder(out.parent)
        result = search(tuner, keep, swarm)
    except SagittalError as error:
        sys.stderr.write(f"Not tuned ({error.code}): {error.message}\n")
        return 1
    except KeyboardInterrupt:
        _explain_stop(checkpoint)
        return 130
    fs.write_file(out, json.dumps(result.to_json(), indent=1, ensure_ascii=False).encode())
    fs.remove_file(checkpoint)
    sys.stderr.write("\n")
    sys.stdout.write(f"{json.dumps(result.gains)}\n{result.verdict}\nWritten to {out}.\n")
    return 0


def _say_progress(share: float, message: str) -> None:
    sys.stderr.write(f"\r{100 * share:5.1f} %  {message}\x1b[K")
    sys.stderr.flush()


def _explain_stop(checkpoint: Path) -> None:
    hint = f"The same command with --resume {checkpoint} goes on." if checkpoint.exists() else ""
    sys.stderr.write(f"\nStopped. {hint}\n")
