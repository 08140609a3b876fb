"""Which version of the code makes the numbers."""

from typing import Final

from sagittal import __version__

CODE_VERSION: Final = __version__
"""Version of this source, also where an older one was installed in its place as editable."""
