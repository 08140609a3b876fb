"""Version of the code that computed the results."""

from typing import Final

from sagittal import __version__

CODE_VERSION: Final = __version__
"""Version of this source, even if an older one was installed as editable."""
