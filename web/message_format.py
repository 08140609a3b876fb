"""Formatting of the values of messages in a language: numbers, dates and quotations."""

from __future__ import annotations

import datetime as dt
import functools
import re
from collections.abc import Mapping
from typing import Final

from babel import Locale
from babel.dates import format_date
from babel.numbers import format_decimal

from sagittal.core.message import PLACEHOLDER

MONTHS: Final = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")

QUOTATION_MARKS: Final[Mapping[str, str]] = {"de": "„{}“"}

_ENTITY: Final = re.compile(r"&\w+;")
_QUOTED_PLACEHOLDER: Final = re.compile(r"“(\{\w+\})”")
_DECIMAL: Final = re.compile(r"(?<![\w.,])(?<!BY )(\d+)\.(\d+)(?![\d.])")
_DATE: Final = re.compile(rf"\b(\d{{1,2}}) ({'|'.join(MONTHS)})(?: (\d{{4}}))?\b")


class ValueFormat:
    """Formatting of numbers and dates in one language."""

    def __init__(self, language: str) -> None:
        self.quotation_marks = QUOTATION_MARKS.get(language, "“{}”")
        self._locale = Locale.parse(language)
        self.decimal_mark = format_decimal(0.1, locale=self._locale)[1]

    def localise(self, text: str) -> str:
        """Localise numbers and dates within a text."""
        if not any(map(str.isdigit, text)):
            return text
        return _DECIMAL.sub(rf"\1{self.decimal_mark}\2", _DATE.sub(self._rewrite_date, text))

    def mark_quotations(self, text: str) -> str:
        """Replace quotation marks around placeholders by those of the language."""
        if "“{" not in text:
            return text
        return _QUOTED_PLACEHOLDER.sub(lambda match: self.quotation_marks.format(match[1]), text)

    def day(self, value: dt.date | dt.datetime) -> str:
        """A date as "18.11.2026"."""
        return str(format_date(value, "medium", locale=self._locale))

    def find_date(self, text: str) -> str | None:
        """Localise a text that is an English date; None for other texts."""
        date = _DATE.fullmatch(text)
        return None if date is None else self._rewrite_date(date)

    def _rewrite_date(self, match: re.Match[str]) -> str:
        day, month, year = match.groups()
        value = dt.date(int(year or 2000), MONTHS.index(month) + 1, int(day))
        return self.day(value) if year else str(format_date(value, "d. MMM", locale=self._locale))


@functools.cache
def has_words(message: str) -> bool:
    """Whether a message contains anything to translate."""
    return re.search(r"[^\W\d_]{2}", PLACEHOLDER.sub(" ", _ENTITY.sub(" ", message))) is not None


def fill_placeholders(said: str, values: Mapping[str, str]) -> str:
    """Replace `{placeholders}` by their values; those without a value remain."""
    return PLACEHOLDER.sub(lambda m: values.get(m[1], m[0]), said)


def match_case(text: str, translation: str) -> str:
    """Capitalize if the English `text` is capitalized; German nouns keep their capitals."""
    return translation[:1].upper() + translation[1:] if text[:1].isupper() else translation
