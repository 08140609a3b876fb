"""Python interface of Sagittal: read, analyse and simulate recordings (docs/reference/python.md).

The names in `__all__` are stable across versions; everything else in this distribution may change. Importing
this package is cheap: dependencies are loaded on first use.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sagittal.analysis import Analysis
    from sagittal.core.errors import Notice, SagittalError
    from sagittal.core.signals.recording import Recording
    from sagittal.functions import analyse, read, simulate
    from sagittal.simulated import SimulatedWalk

__all__ = ["Analysis", "Notice", "Recording", "SagittalError", "SimulatedWalk", "analyse", "read", "simulate"]

__version__ = "0.2.0"

_DIRECTORY = Path(__file__).parent
if (_DIRECTORY / "core").is_file():
    raise ImportError(
        f"{_DIRECTORY / 'core'} is a text file instead of a symbolic link to a folder: git checked out the "
        "links of this clone as text. Run `git config core.symlinks true` and `git checkout -- sagittal` "
        "(on Windows with developer mode on), or install the wheel, which has no links."
    )

_HOMES = {
    "Analysis": "sagittal.analysis",
    "Notice": "sagittal.core.errors",
    "Recording": "sagittal.core.signals.recording",
    "SagittalError": "sagittal.core.errors",
    "SimulatedWalk": "sagittal.simulated",
    "analyse": "sagittal.functions",
    "read": "sagittal.functions",
    "simulate": "sagittal.functions",
}
"""Public name → module that has it."""


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'sagittal' has no attribute '{name}'")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
