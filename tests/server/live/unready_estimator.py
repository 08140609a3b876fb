"""The estimator process, but it is not warm before the file named by UNREADY_UNTIL is there."""

from __future__ import annotations

import os
import time
from pathlib import Path

from sagittal.server.live import estimator

UNTIL = "UNREADY_UNTIL"


def compile_slowly() -> None:
    """Take as long as the test wants."""
    while not Path(os.environ[UNTIL]).exists():
        time.sleep(0.02)


if __name__ == "__main__":
    setattr(estimator, "compile_kernels", compile_slowly)  # noqa: B010 - the name is the estimator's own
    estimator.main()
