"""Texts of sentences that were stored or put together without their templates, guessed from the English.

A `Message` needs none of this: its template is looked up. Results of earlier versions hold finished English
sentences, and some pages still join theirs from parts; the message that one was made from is found by its
pattern. This module can go when neither is left.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from sagittal.core.message import PLACEHOLDER, find_verbatim
from sagittal.web.message_format import ValueFormat, fill_placeholders, match_case

QUOTED: Final = re.compile(r"“((?:[^“”]|“[^“”]*”)*)”")
"""A quotation: nothing in it is translated, unless a message itself has these words in quotation marks."""

LONGEST: Final = 500
"""Characters up to which a text is looked for as a whole; a longer one by its sentences."""

MOST_PARTS: Final = 12

FIRST_MASK: Final = 0xE000
MOST_MASKS: Final = 1000
"""Signs of the private use area that stand for quotations and values while a sentence is translated."""

STRONG: Final = 12
"""Letters of its own from which on a message is not mistaken for another."""

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
"""What pages put between parts that are messages of their own, the strongest first."""

CITED: Final = re.compile(
    r"\b(19|20)\d\d\b.*(:|\d\(\d|Proc\.|Conf|Sens|IEEE)|^[A-Z][a-z]+(Martin)?(19|20)\d\d|et al\. (19|20)\d\d$"
)
"""References to papers stay as they are written."""


class SentenceFinder:
    """Finds the messages that finished sentences were made from.

    Parameters
    ----------
    messages : English text with {placeholders} → text of the language.
    values : the numbers and dates of the language.
    """

    def __init__(self, messages: Mapping[str, str], values: ValueFormat) -> None:
        self.messages = messages
        self._values = values
        self._folded = {text.casefold(): said for text, said in messages.items()}
        self._patterns = [_Pattern(text, said) for text, said in messages.items() if PLACEHOLDER.search(text)]
        # of two that fit, the one with more words of its own
        self._patterns.sort(key=lambda p: -p.literal)
        self._own_quotations = {quoted for text in messages for quoted in QUOTED.findall(text)}
        self._known = functools.lru_cache(maxsize=20_000)(self._find)

    def find(self, text: str) -> str | None:
        """A text in the language; None where no part of it is made from a message."""
        masked, quotations = self._mask(text)
        known = self._known(masked)
        said = self._loosely(masked.strip()) if known is None else known
        return None if said is None else self._unmask(said, quotations)

    def _mask(self, text: str) -> tuple[str, list[str]]:
        """Replace each quotation by a character that occurs in no message or number."""
        quotations: list[str] = []

        def mask(found: re.Match[str]) -> str:
            if found[1] in self._own_quotations or len(quotations) == MOST_MASKS:
                return found[0]
            quotations.append(found[1])
            return f"“{chr(FIRST_MASK + len(quotations) - 1)}”"

        return QUOTED.sub(mask, text), quotations

    def _unmask(self, said: str, quotations: Sequence[str]) -> str:
        marks = self._values.quotation_marks
        opening, closing = marks.split("{}")
        said = said.replace("”, “", f"{closing}, {opening}")  # a list of them in one placeholder
        for i, quoted in enumerate(quotations):
            mask = chr(FIRST_MASK + i)
            said = said.replace(f"“{mask}”", marks.format(mask)).replace(mask, quoted)
        return said

    def _loosely(self, text: str) -> str | None:
        """Translate a sentence with foreign text in it, or several sentences of which some are known."""
        made = self._by_pattern(text, strong=True, loose=True) if len(text) <= LONGEST else None
        made = made or self._by_sentences(_SENTENCE.split(text), partly=True)
        return text if made is None and CITED.search(text) else made

    def _find(self, text: str) -> str | None:
        inner = text.strip()
        if not inner:
            return text
        said = (
            self._exact(inner)
            or self._plain(inner)
            or (self._made(inner) if len(inner) <= LONGEST else None)
            or self._by_sentences(_SENTENCE.split(inner), partly=False)
        )
        return None if said is None else text.replace(inner, said, 1)

    def _exact(self, text: str) -> str | None:
        said = self.messages.get(text)
        if said is None:
            folded = self._folded.get(text.casefold())
            said = None if folded is None else match_case(text, folded)
        return said

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
        before = self._known(text[:-1])
        return None if before is None else before + text[-1]

    def _plain(self, text: str) -> str | None:
        """Format a date, a number, or a name in capitals."""
        date = self._values.find_date(text)
        if date is not None:
            return date
        found = _MEASURED.fullmatch(text)
        if found and found[3] in self.messages:
            return f"{self._values.localise(found[1])}{found[2]}{self.messages[found[3]]}"
        if not re.search(r"[a-zäöüß]", re.sub(r"(?<![^\W\d_])[^\W\d_](?![^\W\d_])", "", text)):
            # numbers, single letters, names of capitals
            said = self._by_pattern(text, strong=False) if re.search(r"[^\W\d_]", text) else None
            return self._values.localise(text) if said is None else said
        return None

    def _measured(self, text: str) -> str | None:
        """Translate a number with its unit, or a word with its number."""
        numbered = _NUMBERED.fullmatch(text)
        if numbered and (word := self._known(numbered[1])) is not None:
            return word + self._values.localise(numbered[2])
        found = _MEASURED.fullmatch(text)
        if not found:
            return None
        unit = self._exact(found[3]) or self._by_pattern(found[3], strong=False)
        if unit is None and re.fullmatch(r"\S{1,7}", found[3]):
            unit = found[3]  # m/s, kHz, MB
        return None if unit is None else f"{self._values.localise(found[1])}{found[2]}{unit}"

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
            known = value if name in pattern.verbatim else self._known(value)
            if known is not None and (name in pattern.verbatim or re.search(r"[^\W\d_]", known)):
                mask = chr(FIRST_MASK + MOST_MASKS + n)
                said[name], settled[mask] = mask, known
            else:
                # a number may stand in two placeholders side by side
                said[name] = value if known is None else known
        filled = self._values.localise(fill_placeholders(pattern.said, said))
        return re.sub("|".join(settled) or "(?!)", lambda found: settled[found[0]], filled)

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
            at = text.rfind(join)
            while at > 0:
                said = self._join(text[:at], join, text[at + len(join) :])
                if said is not None:
                    return said
                at = text.rfind(join, 0, at)
        return None

    def _join(self, first: str, join: str, second: str) -> str | None:
        if not first or not second:
            return None
        # "; and so on" may be a message with what joins it
        tail = self.messages.get(f"{join}{second}".strip()) or self._by_pattern(
            f"{join}{second}".strip(), strong=True
        )
        head = self._known(first)
        if head is None:
            head = self.messages.get(f"{first}{join.rstrip()}")
            if head is not None and (rest := self._known(second)) is not None:
                return f"{head} {rest}"
            return None
        if tail is not None:
            return f"{head}{tail}" if tail[0] in ",;:" else f"{head} {tail}"
        rest = self._known(second)
        if rest is None:
            return None
        return (
            f"{head} {self.messages.get('and', 'and')} {rest}" if join == " and " else f"{head}{join}{rest}"
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
                known = self._exact(whole)
                if known is None and len(whole) <= LONGEST:
                    known = self._by_pattern(whole, strong=True, loose=partly)
                if known is None and n == 1:
                    known = self._known(whole)
                if known is None and n == 1 and not partly:
                    return None
                if known is not None or n == 1:
                    said.append(whole if known is None else known)
                    found = found or known is not None
                    sentences = sentences[n:]
                    break
        return " ".join(said) if found else None


class _Pattern:
    """Pattern of the sentences formatted from one message."""

    def __init__(self, text: str, said: str) -> None:
        self.said = said
        self.verbatim = find_verbatim(text)
        pieces = PLACEHOLDER.split(text)
        self.names = pieces[1::2]
        literals = pieces[::2]
        self.literal = sum(len(piece.strip()) for piece in literals)
        self.is_strong = len(re.findall(r"[^\W\d_]", "".join(literals))) >= STRONG
        self._stops = not literals[-1] or literals[-1].endswith(".")
        if not literals[-1] and literals[-2] and not literals[-2].rstrip().endswith((".", ":")):
            self._stops = False  # what stands last is no sentence
        self._longest = max(literals, key=len).casefold()
        first, *rest = map(re.escape, literals)
        # of two values without a word between, the one before is a number and the other its unit
        forms = [
            first
            + "".join(
                (value if piece or i == len(rest) else before) + piece for i, piece in enumerate(rest, 1)
            )
            for value, before in (("(.+?)", r"([−+-]?\d+(?:\.\d+)?)"), ("(.+?)", "(.+?)"), ("(.+)", "(.+)"))
        ]
        self._forms = [re.compile(form, re.DOTALL | re.IGNORECASE) for form in dict.fromkeys(forms)]

    def match(self, text: str) -> Iterator[dict[str, str]]:
        """Yield possible values of the placeholders; none if the text does not match."""
        if (text.endswith(".") and not self._stops) or self._longest not in text.casefold():
            return
        before: tuple[str, ...] = ()
        for form in self._forms:
            found = form.fullmatch(text)
            if found is not None and found.groups() != before:
                before = found.groups()
                yield dict(zip(self.names, before, strict=True))
