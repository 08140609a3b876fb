"""Where the real recordings are: the variable SAGITTAL_DATA, else ../shared/data beside the project."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


def data_folder(*parts: str) -> Path:
    """Folder of recordings, or skip the test with the reason."""
    base = Path(os.environ.get("SAGITTAL_DATA") or ROOT.parent / "shared" / "data")
    path = base.joinpath(*parts)
    if not path.exists():
        pytest.skip(
            f"no recordings: {'/'.join(parts) or 'data'} not found; set SAGITTAL_DATA to the data folder"
        )
    return path
