"""Which version of the code makes the numbers."""

from importlib.metadata import PackageNotFoundError, version
from typing import Final


def _version() -> str:
    try:
        return version("sagittal")
    except PackageNotFoundError:
        return "source"


CODE_VERSION: Final = _version()
"""Version of the installed distribution; "source" when run from a tree that is not installed."""
