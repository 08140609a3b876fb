"""`sagittal tune`: gains of one filter fitted to recordings with a reference, by the service's code."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from sagittal.server.storage import fs


def tune(folder: Path, out: Path, resume: Path | None, **order: Any) -> int:
    """Fit gains to the trials of a folder and write them to `out`; a checkpoint lies beside it meanwhile.

    Parameters
    ----------
    resume : a checkpoint to go on from. order : see `TuningOrder`.

    Returns
    -------
    0 = done, better or not; 1 = not possible, 130 = interrupted.
    """
    from sagittal.core.errors import SagittalError
    from sagittal.core.formats import list_source_files, read_named_file
    from sagittal.server.results.tunings import TuningOrder, prepare, search

    checkpoint = out.with_name(f"{out.name}.checkpoint")

    def keep(content: bytes, share: float, message: str) -> None:
        fs.write_file(checkpoint, content)
        sys.stderr.write(f"\r{100 * share:5.1f} %  {message}\x1b[K")
        sys.stderr.flush()

    try:
        tuner = prepare(list(list_source_files([folder])), TuningOrder(**order))
        swarm = tuner.read_checkpoint(read_named_file(resume)) if resume else None
        fs.make_folder(out.parent)
        result = search(tuner, keep, swarm)
    except SagittalError as error:
        sys.stderr.write(f"Not tuned ({error.code}): {error.message}\n")
        return 1
    except KeyboardInterrupt:
        again = f"The same command with --resume {checkpoint} goes on." if checkpoint.exists() else ""
        sys.stderr.write(f"\nStopped. {again}\n")
        return 130
    fs.write_file(out, json.dumps(result.to_json(), indent=1, ensure_ascii=False).encode())
    fs.remove_file(checkpoint)
    sys.stderr.write("\n")
    sys.stdout.write(f"{json.dumps(result.gains)}\n{result.verdict}\nWritten to {out}.\n")
    return 0
