"""Translation functions for templates: every text and value on a page passes through here."""

from __future__ import annotations

import datetime as dt
import html
import re
from collections.abc import Callable, Mapping
from typing import Any, Final

from markupsafe import Markup, escape

from sagittal.web.language import Catalogue
from sagittal.web.words import Verbatim, number

SPOKEN_KEYS: Final = frozenset(
    {
        "comparison", "detail", "down", "everyday", "headline", "hint", "label", "name_words", "say", "text",
        "title", "todo", "unit", "up", "why", "word", "words",
    }
)  # fmt: skip
"""Keys of page data for scripts whose values are user-visible text."""

SPOKEN_MAPS: Final = frozenset({"segments"})
"""Likewise for mappings, all of whose values are."""

_FIGURE_TEXT: Final = re.compile(
    r"(<(?:text|title|tspan)\b[^>]*>)([^<]+)(?=<)|((?:aria-label|title)=\")([^\"]+)(?=\")"
)


class Shown:
    """Formatting of texts and values in one language.

    Parameters
    ----------
    catalogue : of the language.
    """

    def __init__(self, catalogue: Catalogue) -> None:
        self._catalogue = catalogue

    @property
    def functions(self) -> dict[str, Callable[..., object]]:
        """Functions called by the output of `sagittal.web.template_texts.speak_template`, by name."""
        return {
            "say": self.say,
            "say_plain": self.say_plain,
            "say_message": self.say_message,
            "say_plain_message": self.say_message,
        }

    @property
    def filters(self) -> dict[str, Callable[..., object]]:
        """Filters specific to this language."""
        return {
            "day": lambda value: Verbatim(self._catalogue.day(value)),
            "moment": self._moment,
            "number": lambda value, digits=0: Verbatim(self._catalogue.translate(number(value, digits))),
            "safe": lambda value: Markup(self.say_figure(str(value))),  # noqa: S704 - drawn by us
            "filled": self.say_message,
            "spoken": self.say_members,
            "said": self.say_plain,
            "meant": lambda text, meaning: Verbatim(self._catalogue.translate(f"{text} ({meaning})")),
            "verbatim": lambda value: Verbatim(value) if isinstance(value, str) else value,
        }

    def _moment(self, value: dt.datetime) -> Verbatim:
        utc = value.astimezone(dt.UTC)
        return Verbatim(f"{self._catalogue.day(utc)}, {utc:%H:%M}")

    def say_plain(self, value: object) -> object:
        """Translate a value in an attribute."""
        if not isinstance(value, str) or isinstance(value, Verbatim) or hasattr(value, "__html__"):
            return value
        return self._catalogue.translate(value)

    def say(self, value: object) -> object:
        """Translate a value between tags; unknown sentences stay English and are marked as such."""
        if not isinstance(value, str) or isinstance(value, Verbatim) or hasattr(value, "__html__"):
            return value
        translation = self._catalogue.find(value)
        if translation is None and re.search(r"[^\W\d_]{2}\s+[^\W\d_]{2}", value):
            return Markup('<span lang="en">{}</span>').format(value)
        return value if translation is None else translation

    def say_message(self, message: str, **values: object) -> Markup:
        """Translate a text of a template, which may contain entities; its values are escaped here."""
        escaped = {name: str(escape(self.say_plain(value))) for name, value in values.items()}
        return Markup(self._catalogue.fill(message, escaped))  # noqa: S704 - templates are ours, values escaped

    def say_figure(self, drawn: str) -> str:
        """Translate labels and titles of a figure."""

        def speak(match: re.Match[str]) -> str:
            opening, text = (match[1], match[2]) if match[1] else (match[3], match[4])
            return f"{opening}{escape(self._catalogue.translate(html.unescape(text)))}"

        return _FIGURE_TEXT.sub(speak, drawn)

    def say_members(self, value: Any, key: str = "") -> Any:
        """Translate the user-visible texts of data passed to scripts."""
        if isinstance(value, Mapping):
            return {k: self.say_members(v, key if key in SPOKEN_MAPS else str(k)) for k, v in value.items()}
        if isinstance(value, list | tuple):
            return [self.say_members(v, key) for v in value]
        if isinstance(value, str) and key in SPOKEN_KEYS | SPOKEN_MAPS:
            return self.say_plain(value)
        return value
