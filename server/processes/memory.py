"""One allocator for all libraries."""

from __future__ import annotations

import os


def share_allocator() -> None:
    """Let Arrow take its memory where NumPy does; call it before Arrow is imported.

    Its own allocator keeps 15 MB that it has let go of.
    """
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
