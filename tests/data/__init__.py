"""Where the real recordings are: the variable SAGITTAL_DATA, else ../shared/data beside the project.

One walk, the feet of `gaitmap_foot`, lies in this folder and is always there.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent


def data_folder(*parts: str) -> Path:
    """Folder or file of recordings, or skip the test with the reason."""
    base = Path(os.environ.get("SAGITTAL_DATA") or ROOT.parent / "shared" / "data")
    for folder in (base, HERE) if parts else (base,):
        if (path := folder.joinpath(*parts)).exists():
            return path
    pytest.skip(f"no recordings: {'/'.join(parts) or 'data'} not found; set SAGITTAL_DATA to the data folder")
