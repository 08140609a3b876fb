"""`sagittal warm`: compile the filters before anybody waits for them, at installation or in an image."""

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
    """Compile every filter of walks, offline and live, into the folder of compiled filters; 0 when done.

    What is in the folder already is only loaded. Processors differ: run it on the machine that will analyse.
    """
    steps: tuple[tuple[str, Callable[[], None]], ...] = (
        ("filters of takes and of live sessions, two at a time", compile_filters),
        ("a whole analysis of a simulated walk", _analyse_walk),
    )
    folder = Path(os.environ[VARIABLE])
    fs.make_folder(folder)
    with fs.open_scratch(folder):  # minutes of work that could not be kept help nobody
        pass
    say(f"Compiling into {folder}")
    for k, (name, compile_step) in enumerate(steps, 1):
        began = time.monotonic()
        compile_step()
        say(f"{k} of {len(steps)}: {name}, {time.monotonic() - began:.0f} s")
    return 0


def _analyse_walk() -> None:
    """By the real chain: which filters a walk asks for, only that knows."""
    from sagittal.core.pipeline import analyse
    from sagittal.core.simulate import simulate_scenario

    made = analyse(simulate_scenario("comfortable", 1).recording)
    if made.problem is not None:
        raise RuntimeError(f"The simulated walk was not analysed: {made.problem.message}")
