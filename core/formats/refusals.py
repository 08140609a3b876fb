"""Sentences that explain why an upload holds no recording."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from sagittal.core.errors import FormatError, InputError, Notice
from sagittal.core.formats import text
from sagittal.core.formats.vendors.registry import list_formats
from sagittal.core.plurals import plural

MOST_SHOWN: Final = 5
"""Different causes named one by one."""


def explain_manifest(name: str, data: bytes) -> str:
    """Explain that a table needs a manifest, with its first line."""
    lines = text.head_lines(data, 2)
    start = lines[0][:80].decode("utf-8", errors="replace")
    return (
        f"{name} is a table that starts with '{start}'; say in a manifest which columns are which sensor "
        "and their units (docs/reference/formats.md)."
    )


def explain_unreadable(problems: Sequence[tuple[str, InputError]], notices: Sequence[Notice]) -> FormatError:
    """Error for an upload without a recording: the one cause that all files share, else a summary.

    Parameters
    ----------
    problems : file name and its error. notices : about files that were ignored.
    """
    alike: dict[tuple[str, str], list[InputError]] = {}
    for name, e in problems:
        alike.setdefault((e.code, e.message.replace(name, "")), []).append(e)
    if len(alike) == 1:
        (errors,) = alike.values()
        first = errors[0]
        return FormatError(first.code, _explain_alike(errors), sensor=first.sensor, t_s=first.t_s)
    codes = {code for code, _ in alike}
    lines = [_explain_alike(errors) for errors in alike.values()] + [n.message for n in notices]
    summary = " ".join(lines[:MOST_SHOWN])
    if len(lines) > MOST_SHOWN:
        summary += f" … and {len(lines) - MOST_SHOWN} more."
    code = codes.pop() if len(codes) == 1 and not notices else "unknown_format"
    return FormatError(code, f"No sensor recording was found; tried {list_formats()}. {summary}")


def _explain_alike(errors: Sequence[InputError]) -> str:
    """Message of one of several files with the same fault, with the number of the others."""
    count = len(errors) - 1
    if not count:
        return errors[0].message
    return f"{errors[0].message} The same holds of {count} other {plural(count, 'file', 'files')}."
