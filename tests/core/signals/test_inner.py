"""Functions compiled for compiled callers: Python gets an error, never a crash, and their callers work."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from sagittal import core

CALL_ALL = """
import importlib, sys
import numpy as np
from numba.core.dispatcher import Dispatcher

found = {}
for module in sys.argv[1:]:
    for value in vars(importlib.import_module(module)).values():
        if isinstance(value, Dispatcher) and value.targetoptions.get("no_cpython_wrapper"):
            found[f"{value.py_func.__module__}.{value.py_func.__qualname__}"] = value

# one with arguments that fit: machine code without an entry point for Python is what a call would jump to
fitting = {
    "sagittal.core.body.erkf.kernel.is_within_gate": (np.eye(6), 0, np.zeros(3), 1.0, 9.0),
    "sagittal.core.rotation.compiled.sine_quotients": (0.25,),
}
for name, function in sorted(found.items(), key=lambda item: item[0] not in fitting):
    count = function.py_func.__code__.co_argcount
    for arguments in (fitting.get(name, ()), (), (1.0,) * count):
        try:
            function(*arguments)
        except TypeError as error:
            assert name in str(error) and "py_func" in str(error), error
        else:
            sys.exit(f"{name} returned a value")
    print(name)
"""


def test_calling_an_inner_function_from_python_raises_and_the_process_survives() -> None:
    root = Path(core.__file__).parent
    texts = {p.relative_to(root.parent): p.read_text() for p in sorted(root.rglob("*.py"))}
    marks = {
        p: len(re.findall(r"^@inner_njit\(|^@.*no_cpython_wrapper", t, re.MULTILINE))
        for p, t in texts.items()
    }
    modules = [".".join(("sagittal", *p.with_suffix("").parts)) for p, count in marks.items() if count]
    command = [sys.executable, "-c", CALL_ALL, *modules]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr[-2000:]
    assert len(run.stdout.split()) == sum(marks.values()) > 50


USE = """
import numba, numpy as np
from sagittal.core.rotation.compiled import exp_so3, sine_quotients

rotation, jacobian = np.empty((3, 3)), np.empty((3, 3))
exp_so3(np.array([0.0, 0.0, np.pi / 2]), rotation, jacobian)
np.testing.assert_allclose(rotation, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)
np.testing.assert_allclose(numba.njit(sine_quotients.py_func)(0.25), sine_quotients.py_func(0.25))
print(sum(exp_so3.stats.cache_hits.values()))
"""


@pytest.mark.slow
def test_compiled_callers_use_an_inner_function_also_from_the_cache_on_disk(tmp_path: Path) -> None:
    env = {"NUMBA_CACHE_DIR": str(tmp_path), "PATH": ""}
    hits = [
        subprocess.run(
            [sys.executable, "-c", USE], env=env, capture_output=True, text=True, check=True
        ).stdout
        for _ in range(2)
    ]
    assert [int(x) for x in hits] == [0, 1]
