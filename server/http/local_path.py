"""Where a browser is led: never to another server than this one."""

from __future__ import annotations


def local_path(path: str | None) -> str:
    """Return where to go after signing in: a path of this server, else the patients."""
    # browsers read // and /\\ as the start of another host, and drop control characters first
    if not path or not path.isprintable() or not path.startswith("/") or path[1:2] in {"/", "\\"}:
        return "/patients"
    return path
