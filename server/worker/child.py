"""Compute process: pre-warmed, killable, limited in memory and without access to the database.

Started by server/worker/runner.py as `python -m sagittal.server.worker.child <socket> <parent pid>`.
"""

from __future__ import annotations

import logging

from sagittal.core.errors import SagittalError
from sagittal.core.formats.source import SourceFile
from sagittal.server.jobs.attempt import Attempt
from sagittal.server.processes.channel import Channel
from sagittal.server.processes.child import enter_child
from sagittal.server.storage.files.blob_opening import open_blobs
from sagittal.server.storage.files.blob_source import open_source
from sagittal.server.storage.files.blobs import BlobStore, StoreAway
from sagittal.server.storage.refusal import refusal_of
from sagittal.server.worker.messages import (
    Checkpoint,
    ChildReady,
    Failure,
    Input,
    Order,
    Result,
    Stage,
    decode_order,
    encode,
)
from sagittal.server.worker.task import TASKS, load

log = logging.getLogger("sagittal.server.worker.child")


def main() -> None:
    """Process orders until the worker closes the socket."""
    line, settings = enter_child()
    load(settings.task_modules)
    for task in TASKS.values():
        task.warm()
    store = open_blobs(settings)
    line.send(encode(ChildReady()))
    while True:
        try:
            order = decode_order(line.receive())
        except EOFError:
            return
        line.send(encode(compute(order, store, line)))


def compute(order: Order, store: BlobStore, line: Channel) -> Result | Failure:
    """Carry out one order; any error becomes a response and never ends the process."""
    try:
        files = [_open(store, order.space, file) for file in order.files]
        left = None
        if order.space is not None and order.checkpoint is not None:
            left = store.read(order.space, order.checkpoint)
        attempt = Attempt(
            progress=lambda stage, share, message=None: line.send(
                encode(Stage(stage, float(share), message))
            ),
            keep=lambda content: line.send(encode(Checkpoint(content))),
            checkpoint=left,
        )
        return Result(TASKS[order.kind].run(files, order.params, attempt))
    except StoreAway as error:
        return Failure(error.code, error.message, passing=True)
    except SagittalError as error:
        return Failure(error.code, error.message)
    except MemoryError:
        return Failure(
            "out_of_memory",
            "The recording needs more memory than one analysis may use. Analyse a shorter part of it, or ask "
            "the administrator (SAGITTAL_CHILD_MEMORY_BYTES).",
        )
    except Exception as error:
        log.exception("job of kind %s failed unexpectedly", order.kind)
        refusal = refusal_of(error)
        if refusal is not None:
            return Failure(refusal.value, refusal.sentence)
        return Failure(
            "internal_error",
            "The analysis stopped on an error of the program, not of the recording. "
            "The server's log has the details; please report it.",
        )


def _open(store: BlobStore, space: str | None, file: Input) -> SourceFile:
    if space is None:
        raise ValueError("An order with files names the space they lie in.")
    return open_source(store, space, file.name, file.size, file.sha256)


if __name__ == "__main__":
    main()
