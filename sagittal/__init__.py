"""Sagittal from Python: read a recording, analyse it, simulate one (docs/python.md).

What `__all__` lists is kept from version to version; nothing else of this distribution is promised to stay.
Importing this package is cheap: what it needs is loaded when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from core.errors import Notice, SagittalError
    from core.recording import Recording
    from sagittal.analysis import Analysis
    from sagittal.functions import analyse, read, simulate
    from sagittal.simulated import SimulatedWalk

__all__ = ["Analysis", "Notice", "Recording", "SagittalError", "SimulatedWalk", "analyse", "read", "simulate"]

_HOMES = {
    "Analysis": "sagittal.analysis",
    "Notice": "core.errors",
    "Recording": "core.recording",
    "SagittalError": "core.errors",
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
