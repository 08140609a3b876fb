"""Kinds of jobs: computation in the child, and publication of results by the worker."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sqlalchemy import Connection

from sagittal.server.jobs.attempt import Attempt
from sagittal.server.jobs.queue import Claim
from sagittal.server.storage.files.blobs import Blob

if TYPE_CHECKING:
    from sagittal.core.formats.source import SourceFile


def _nothing() -> None:
    """No-op for kinds without warm-up."""


@dataclass(frozen=True)
class Task:
    """One kind of job.

    Parameters
    ----------
    run : in the child: (files, the job's params, attempt) → result files; raises SagittalError.
    publish : in the worker, inside the transaction that marks the job done: (connection, claim, result files,
        their blobs). If it raises SagittalError, the job fails and nothing is written.
    keeps_files : whether the result files are stored as blobs before the transaction.
    warm : imports and compiles everything required by `run`, once per child.
    """

    kind: str
    run: Callable[[Sequence[SourceFile], Mapping[str, Any], Attempt], dict[str, bytes]]
    publish: Callable[[Connection, Claim, Mapping[str, bytes], Mapping[str, Blob]], None]
    keeps_files: bool
    warm: Callable[[], None] = _nothing


TASKS: dict[str, Task] = {}
"""Kind → task; filled by the modules in settings.task_modules."""


def register(task: Task) -> Task:
    """Register a kind; registering it twice is an error."""
    if TASKS.setdefault(task.kind, task) is not task:
        raise ValueError(f"Two tasks are named {task.kind}.")
    return task


def load(modules: Iterable[str]) -> None:
    """Import the modules that register kinds."""
    for module in modules:
        importlib.import_module(module)
