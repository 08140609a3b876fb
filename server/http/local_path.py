"""Redirect targets, restricted to this server."""

from __future__ import annotations


def local_path(path: str | None) -> str:
    """Return the path to open after signing in: the given path if local, otherwise the patient list."""
    # browsers read // and /\\ as the start of another host, and drop control characters first
    if not path or not path.isprintable() or not path.startswith("/") or path[1:2] in {"/", "\\"}:
        return "/patients"
    return path
