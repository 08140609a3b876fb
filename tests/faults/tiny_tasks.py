"""A small real job type for fault tests: it passes through stages and stops as its params demand.

params: hold_at (a stage, or "publish": waits for `gate` after creating `reached`), die_at, error ("known",
"bug", "memory"), spin (never ends or reports).
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sqlalchemy import Connection

from sagittal.core.errors import SignalError
from sagittal.core.formats.source import SourceFile
from sagittal.server.jobs.attempt import Attempt
from sagittal.server.jobs.queue import Claim
from sagittal.server.results import analyses
from sagittal.server.storage.files.blobs import Blob
from sagittal.server.worker.task import Task, register

STAGES = ("first", "second", "third")


def run(files: Sequence[SourceFile], params: Mapping[str, Any], attempt: Attempt) -> dict[str, bytes]:
    for i, stage in enumerate(STAGES):
        attempt.progress(stage, i / len(STAGES))
        _meet(params, stage)
        if params.get("die_at") == stage:
            os.kill(os.getpid(), signal.SIGKILL)
    match params.get("error"):
        case "known":
            raise SignalError("no_walking", "No walking was found; record at least six steps.")
        case "bug":
            raise ZeroDivisionError
        case "memory":
            bytearray(5 << 30)  # untouched, so only the limit of the address space refuses it
    while params.get("spin"):
        pass
    return {"result.txt": b"".join(f.read() for f in files) or b"nothing"}


def publish(c: Connection, claim: Claim, files: Mapping[str, bytes], blobs: Mapping[str, Blob]) -> None:
    analyses.publish(c, claim, blobs, "0" * 64)
    _meet(claim.params, "publish")


def _meet(params: Mapping[str, Any], stage: str) -> None:
    if params.get("hold_at") != stage:
        return
    Path(params["reached"]).write_text(str(os.getpid()))
    while not Path(params["gate"]).exists():
        time.sleep(0.01)


register(Task("tiny", run, publish, keeps_files=True))
