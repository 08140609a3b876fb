"""Kernels as plain Python: what only compiled functions may call can be tried, and nothing is compiled."""

from __future__ import annotations

import sys
from types import ModuleType

import pytest
from numba.core.dispatcher import Dispatcher


def run_uncompiled(monkeypatch: pytest.MonkeyPatch, *modules: ModuleType) -> None:
    """Run the kernels of these modules, and of those they call, uncompiled."""
    waiting, observations = list(modules), set[str]()
    while waiting:
        module = waiting.pop()
        observations.add(module.__name__)
        for name, value in list(vars(module).items()):
            if isinstance(value, Dispatcher):
                monkeypatch.setattr(module, name, value.py_func)
                if value.py_func.__module__ not in observations:
                    waiting.append(sys.modules[value.py_func.__module__])
