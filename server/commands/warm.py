"""`sagittal warm`: compile the filters in advance, at installation or in an image."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

from sagittal.server.commands.serve import say
from sagittal.server.processes.compiling import compile_filters
from sagittal.server.storage import fs
from sagittal.server.storage.compile_cache import VARIABLE


def warm() -> int:
    """Compile every filter for walks, offline and live, into the folder of compiled filters; 0 when done.

    Filters already in the folder are only loaded. Compiled code depends on the processor: run this on the
    machine that will analyse.
    """
    steps: tuple[tuple[str, Callable[[], None]], ...] = (
        ("filters of takes and of live sessions, two at a time", compile_filters),
        ("a whole analysis of a simulated walk", _analyse_walk),
    )
    folder = Path(os.environ[VARIABLE])
    fs.make_folder(folder)
    with fs.open_scratch(folder):  # avoid minutes of work that could not be saved
        pass
    say(f"Compiling into {folder}")
    for k, (name, compile_step) in enumerate(steps, 1):
        began = time.monotonic()
        compile_step()
        say(f"{k} of {len(steps)}: {name}, {time.monotonic() - began:.0f} s")
    return 0


def _analyse_walk() -> None:
    """Run the complete pipeline, as only it determines which filters a walk requires."""
    from sagittal.core.pipeline import analyse
    from sagittal.core.simulate import simulate_scenario

    analysis = analyse(simulate_scenario("comfortable", 1).recording)
    if analysis.problem is not None:
        raise RuntimeError(f"The simulated walk was not analysed: {analysis.problem.message}")
