"""Translation of finished English sentences without a template, by matching the patterns of messages.

A `Message` does not need this, as its template is looked up. Results of earlier versions contain finished
sentences, and some pages still compose theirs from parts. This module can be removed when there are none
left.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from sagittal.core.message import PLACEHOLDER, find_verbatim
from sagittal.web.message_format import ValueFormat, fill_placeholders, match_case

QUOTED: Final = re.compile(r"“((?:[^“”]|“[^“”]*”)*)”")
"""Quotations are not translated unless a message contains them."""

LONGEST: Final = 500
"""Maximum length of texts matched as a whole; longer ones are matched by sentence."""

MOST_PARTS: Final = 12

FIRST_MASK: Final = 0xE000
MOST_MASKS: Final = 1000
"""Private-use characters that represent quotations and values during translation."""

STRONG: Final = 12
"""Minimum number of literal letters for an unambiguous message."""

_MEASURED: Final = re.compile(
    r"([−+±≤≥<>]?\d[\d.,−±–\u2009\u202f ]*?)([\u2009\u202f ]?)([^\d\s.,].*)", re.DOTALL
)
"""A number with its unit."""
_NUMBERED: Final = re.compile(
    r"(.*[^\W\d_])((?:[\u2009\u202f ][±−+]?[\u2009\u202f ]?\d[\d.]*[ \u2009\u202f]?[°%]?)+)", re.DOTALL
)
"""A word with its number."""
_SENTENCE: Final = re.compile(r"(?<=[.!?…])(?<!et al\.)\s+(?=[A-Z0-9“])")
_JOINS: Final = ("; ", " · ", " → ", " | ", ": ", ", ", " – ", " and ")
"""Separators that pages put between messages, the strongest first."""

CITED: Final = re.compile(
    r"\b(19|20)\d\d\b.*(:|\d\(\d|Proc\.|Conf|Sens|IEEE)|^[A-Z][a-z]+(Martin)?(19|20)\d\d|et al\. (19|20)\d\d$"
)
"""References to papers are not translated."""


class SentenceFinder:
    """Finds the messages from which finished sentences were formatted.

    Parameters
    ----------
    messages : English text with {placeholders} → text of the language.
    values : the numbers and dates of the language.
    """

    def __init__(self, messages: Mapping[str, str], values: ValueFormat) -> None:
        self.messages = messages
        self._values = values
        self._folded = {text.casefold(): translation for text, translation in messages.items()}
        self._patterns = [
            _Pattern(text, translation) for text, translation in messages.items() if PLACEHOLDER.search(text)
        ]
        # of two matches, the one with more literal words
        self._patterns.sort(key=lambda p: -p.literal)
        self._own_quotations = {quoted for text in messages for quoted in QUOTED.findall(text)}
        self._known = functools.lru_cache(maxsize=20_000)(self._find)

    def find(self, text: str) -> str | None:
        """Translation of a text; None if no part of it matches a message."""
        masked, quotations = self._mask(text)
        exact = self._known(masked)
        translation = self._loosely(masked.strip()) if exact is None else exact
        return None if translation is None else self._unmask(translation, quotations)

    def _mask(self, text: str) -> tuple[str, list[str]]:
        """Replace each quotation by a character that occurs in no message or number."""
        quotations: list[str] = []

        def mask(match: re.Match[str]) -> str:
            if match[1] in self._own_quotations or len(quotations) == MOST_MASKS:
                return match[0]
            quotations.append(match[1])
            return f"“{chr(FIRST_MASK + len(quotations) - 1)}”"

        return QUOTED.sub(mask, text), quotations

    def _unmask(self, text: str, quotations: Sequence[str]) -> str:
        marks = self._values.quotation_marks
        opening, closing = marks.split("{}")
        text = text.replace("”, “", f"{closing}, {opening}")  # a list of them in one placeholder
        for i, quoted in enumerate(quotations):
            mask = chr(FIRST_MASK + i)
            text = text.replace(f"“{mask}”", marks.format(mask)).replace(mask, quoted)
        return text

    def _loosely(self, text: str) -> str | None:
        """Translate a sentence with foreign text in it, or several sentences of which some are known."""
        made = self._by_pattern(text, strong=True, loose=True) if len(text) <= LONGEST else None
        made = made or self._by_sentences(_SENTENCE.split(text), partly=True)
        return text if made is None and CITED.search(text) else made

    def _find(self, text: str) -> str | None:
        inner = text.strip()
        if not inner:
            return text
        translation = (
            self._exact(inner)
            or self._plain(inner)
            or (self._made(inner) if len(inner) <= LONGEST else None)
            or self._by_sentences(_SENTENCE.split(inner), partly=False)
        )
        return None if translation is None else text.replace(inner, translation, 1)

    def _exact(self, text: str) -> str | None:
        translation = self.messages.get(text)
        if translation is None:
            folded = self._folded.get(text.casefold())
            translation = None if folded is None else match_case(text, folded)
        return translation

    def _made(self, text: str) -> str | None:
        return (
            self._by_pattern(text, strong=True)
            or self._before_stop(text)
            or self._by_parts(text)
            or self._by_pattern(text, strong=False)
            or self._measured(text)
        )

    def _before_stop(self, text: str) -> str | None:
        """Translate a message followed by a full stop added by a page."""
        if text[-1] not in ".:;" or len(text) < 2:
            return None
        sentence = self._known(text[:-1])
        return None if sentence is None else sentence + text[-1]

    def _plain(self, text: str) -> str | None:
        """Format a date, a number, or a name in capitals."""
        date = self._values.find_date(text)
        if date is not None:
            return date
        match = _MEASURED.fullmatch(text)
        if match and match[3] in self.messages:
            return f"{self._values.localise(match[1])}{match[2]}{self.messages[match[3]]}"
        if not re.search(r"[a-zäöüß]", re.sub(r"(?<![^\W\d_])[^\W\d_](?![^\W\d_])", "", text)):
            # numbers, single letters, names in capitals
            translation = self._by_pattern(text, strong=False) if re.search(r"[^\W\d_]", text) else None
            return self._values.localise(text) if translation is None else translation
        return None

    def _measured(self, text: str) -> str | None:
        """Translate a number with its unit, or a word with its number."""
        numbered = _NUMBERED.fullmatch(text)
        if numbered and (word := self._known(numbered[1])) is not None:
            return word + self._values.localise(numbered[2])
        match = _MEASURED.fullmatch(text)
        if not match:
            return None
        unit = self._exact(match[3]) or self._by_pattern(match[3], strong=False)
        if unit is None and re.fullmatch(r"\S{1,7}", match[3]):
            unit = match[3]  # m/s, kHz, MB
        return None if unit is None else f"{self._values.localise(match[1])}{match[2]}{unit}"

    def _by_pattern(self, text: str, *, strong: bool, loose: bool = False) -> str | None:
        """Translate a sentence formatted from a message; `loose` = with any values of its placeholders."""
        for pattern in self._patterns:
            if pattern.is_strong != strong:
                continue
            for values in pattern.match(text):
                spoken = [value for name, value in values.items() if name not in pattern.verbatim]
                if all(map(self._stands_alone, spoken)) or (loose and not any(map(_SENTENCE.search, spoken))):
                    return match_case(text, self._fill_pattern(pattern, values))
        return None

    def _fill_pattern(self, pattern: _Pattern, values: Mapping[str, str]) -> str:
        """Fill a message with untranslated values; numbers are localised, except in user text."""
        said: dict[str, str] = {}
        settled: dict[str, str] = {}
        for n, (name, value) in enumerate(values.items()):
            translation = value if name in pattern.verbatim else self._known(value)
            if translation is not None and (name in pattern.verbatim or re.search(r"[^\W\d_]", translation)):
                mask = chr(FIRST_MASK + MOST_MASKS + n)
                replacements[name], settled[mask] = mask, translation
            else:
                # two adjacent placeholders may share a number
                replacements[name] = value if translation is None else translation
        filled = self._values.localise(fill_placeholders(pattern.said, replacements))
        return re.sub("|".join(settled) or "(?!)", lambda match: settled[match[0]], filled)

    def _stands_alone(self, value: str) -> bool:
        """Whether a value is a single word or complete message rather than part of a sentence."""
        return (
            not re.search(r"\s", value.strip())
            or self._known(value) is not None
            or (not _SENTENCE.search(value) and CITED.search(value) is not None)
        )

    def _by_parts(self, text: str) -> str | None:
        """Translate a text composed of messages."""
        for join in _JOINS:
            if text.count(join) >= MOST_PARTS:
                continue
            position = text.rfind(join)
            while position > 0:
                translation = self._join(text[:position], join, text[position + len(join) :])
                if translation is not None:
                    return translation
                position = text.rfind(join, 0, position)
        return None

    def _join(self, first: str, join: str, second: str) -> str | None:
        if not first or not second:
            return None
        # "; and so on" may be a message including its separator
        tail = self.messages.get(f"{join}{second}".strip()) or self._by_pattern(
            f"{join}{second}".strip(), strong=True
        )
        head = self._known(first)
        if head is None:
            head = self.messages.get(f"{first}{join.rstrip()}")
            if head is not None and (second_part := self._known(second)) is not None:
                return f"{head} {second_part}"
            return None
        if tail is not None:
            return f"{head}{tail}" if tail[0] in ",;:" else f"{head} {tail}"
        second_part = self._known(second)
        if second_part is None:
            return None
        return (
            f"{head} {self.messages.get('and', 'and')} {second_part}"
            if join == " and "
            else f"{head}{join}{second_part}"
        )

    def _by_sentences(self, sentences: list[str], *, partly: bool) -> str | None:
        """Translate consecutive sentences, jointly if they form one message; `partly` = allow unknown
        ones.
        """
        said: list[str] = []
        found = False
        while sentences and (len(sentences) > 1 or said):
            for n in range(len(sentences), 0, -1):
                whole = " ".join(sentences[:n])
                translation = self._exact(whole)
                if translation is None and len(whole) <= LONGEST:
                    translation = self._by_pattern(whole, strong=True, loose=partly)
                if translation is None and n == 1:
                    translation = self._known(whole)
                if translation is None and n == 1 and not partly:
                    return None
                if translation is not None or n == 1:
                    parts.append(whole if translation is None else translation)
                    is_translated = is_translated or translation is not None
                    sentences = sentences[n:]
                    break
        return " ".join(parts) if is_translated else None


class _Pattern:
    """Pattern of the sentences formatted from one message."""

    def __init__(self, text: str, translation: str) -> None:
        self.said = translation
        self.verbatim = find_verbatim(text)
        pieces = PLACEHOLDER.split(text)
        self.names = pieces[1::2]
        literals = pieces[::2]
        self.literal = sum(len(piece.strip()) for piece in literals)
        self.is_strong = len(re.findall(r"[^\W\d_]", "".join(literals))) >= STRONG
        self._stops = not literals[-1] or literals[-1].endswith(".")
        if not literals[-1] and literals[-2] and not literals[-2].rstrip().endswith((".", ":")):
            self._stops = False  # the last literal is not a sentence
        self._longest = max(literals, key=len).casefold()
        first, *later_literals = map(re.escape, literals)
        # of two values without a word in between, the first is a number and the second its unit
        forms = [
            first
            + "".join(
                (value if piece or i == len(later_literals) else value_before) + piece
                for i, piece in enumerate(later_literals, 1)
            )
            for value, value_before in (
                ("(.+?)", r"([−+-]?\d+(?:\.\d+)?)"),
                ("(.+?)", "(.+?)"),
                ("(.+)", "(.+)"),
            )
        ]
        self._forms = [re.compile(form, re.DOTALL | re.IGNORECASE) for form in dict.fromkeys(forms)]

    def match(self, text: str) -> Iterator[dict[str, str]]:
        """Yield possible values of the placeholders; none if the text does not match."""
        if (text.endswith(".") and not self._stops) or self._longest not in text.casefold():
            return
        previous: tuple[str, ...] = ()
        for form in self._forms:
            result = form.fullmatch(text)
            if result is not None and result.groups() != previous:
                previous = result.groups()
                yield dict(zip(self.names, previous, strict=True))
