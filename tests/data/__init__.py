"""Where the real recordings are: the variable SAGITTAL_DATA, else a folder `data` in one beside the project.

One walk, the feet of `gaitmap_foot`, lies in this folder and is always there.
"""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
NO_RECORDINGS = "no recordings"
"""Beginning of the reason for which a test without its recordings is skipped."""
ENGINE = "SAGITTAL_TEST_ENGINE"
"""Environment variable of every test process: where the databases of its clinics are (`--engine`)."""


@cache
def _find_recordings() -> Path | None:
    named = os.environ.get("SAGITTAL_DATA")
    beside = (path.parent for path in sorted(ROOT.parent.glob("*/data/neura_walk")))
    return Path(named) if named else next(beside, None)


def data_folder(*parts: str) -> Path:
    """Folder or file of recordings, or skip the test with the reason."""
    base = _find_recordings()
    if base is not None and (path := base.joinpath(*parts)).exists():
        return path
    # a file only: a folder with some of the recordings would let a test pass that has not seen the others
    if (own := HERE.joinpath(*parts)).is_file():
        return own
    pytest.skip(
        f"{NO_RECORDINGS}: {'/'.join(parts) or 'data'} not found; set SAGITTAL_DATA to the data folder"
    )
