"""Formatting of dates, sizes and numbers on pages: English, true minus sign, thin space before units."""

from __future__ import annotations

import datetime as dt
import functools
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from markupsafe import Markup, escape

from sagittal.web.message_format import MONTHS, fill_placeholders


class Verbatim(str):
    """Text that needs no translation: a formatted date, a generated file name, a hash."""

    __slots__ = ()


def day(value: dt.date | dt.datetime) -> str:
    """A date as "18 Nov 2026"."""
    return f"{value.day} {MONTHS[value.month - 1]} {value.year}"


def moment(value: dt.datetime) -> str:
    """A time as "18 Nov 2026, 10:42" in UTC, the server's only time zone."""
    utc = value.astimezone(dt.UTC)
    return f"{day(utc)}, {utc:%H:%M}"


def filesize(size: float) -> str:
    """Bytes as "18.4 MB", decimal prefixes."""
    for unit in ("B", "kB", "MB"):
        if size < 1000:
            return f"{size:.0f} {unit}" if unit == "B" or size >= 100 else f"{size:.1f} {unit}"
        size /= 1000
    return f"{size:.1f} GB"


def number(value: float | None, digits: int = 0) -> str:
    """A number with a true minus sign and no negative zero; a dash if missing."""
    if value is None:
        return "–"
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0 else text.replace("-", "−")


def seconds(value: float | None) -> str:
    """A duration as "42.6 s" or "3 min 5 s"."""
    if value is None:
        return "–"
    if value < 120:
        return f"{value:.1f} s" if value < 60 else f"{value:.0f} s"
    minutes, remainder = divmod(round(value), 60)
    return f"{minutes} min {remainder} s"


def pattern(text: str) -> str:
    """Escape text for the pattern attribute of an input; its `v` syntax rejects unnecessary escapes."""
    return re.sub(r"[\^$\\.*+?()\[\]{}|/]", r"\\\g<0>", text)


_ICON = re.compile(r'\s*<symbol id="i-([\w-]+)".*?</symbol>', re.DOTALL)
_SHOWN = re.compile(r'href="#i-([\w-]+)"')
_SCRIPTED = re.compile(r'#i-([\w-]+)|\bicon(?:: |\([^()"]*)"([\w-]+)"(?: : "([\w-]+)")?')


@functools.cache
def find_scripted_icons() -> frozenset[str]:
    """Icons used by the pages' scripts."""
    scripts = (Path(__file__).parent / "static" / "js").rglob("*.js")
    name_sets = (names for script in scripts for names in _SCRIPTED.findall(script.read_text("utf-8")))
    return frozenset(name for names in name_sets for name in names if name)


def used_icons(page: str) -> Markup:
    """Remove unused icons from a page, a twentieth of the size of a session page."""
    icons = find_scripted_icons().union(_SHOWN.findall(page))
    symbols, end, tail = str(page).rpartition("</symbol>")
    fewer = _ICON.sub(lambda icon: icon[0] if icon[1] in icons else "", symbols + end)
    return Markup(fewer + tail)  # noqa: S704


def fill_message(message: str, **values: object) -> Markup:
    """Fill a template message with escaped values; the filter `filled`."""
    escaped = {name: str(escape(value)) for name, value in values.items()}
    return Markup(fill_placeholders(message, escaped))  # noqa: S704 - templates are ours, values escaped


def as_it_is(value: Any) -> Any:
    """Return the value unchanged, as English needs no translation."""
    return value


FILTERS: dict[str, Callable[..., Any]] = {
    "day": day,
    "moment": moment,
    "filesize": filesize,
    "number": number,
    "seconds": seconds,
    "used_icons": used_icons,
    "pattern": pattern,
    "filled": fill_message,
    "verbatim": as_it_is,
    "spoken": as_it_is,
    "said": as_it_is,
    "meant": lambda text, meaning: text,
}
"""By the name used in templates."""
