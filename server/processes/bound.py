"""Run a module that ends with its parent process, even while it is still importing.

    python -m sagittal.server.processes.bound MODULE …

Imports take seconds, during which the module cannot monitor its parent itself.
"""

from __future__ import annotations

import os
import runpy
import sys

from sagittal.server.processes.lifeline import call_when_parent_ends

if __name__ == "__main__":
    call_when_parent_ends(lambda: os._exit(1))
    del sys.argv[0]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
