"""Languages of the pages: English in the sources, others as catalogues in web/texts.

A message is an English text with `{placeholders}`; a `Message` of core holds it together with its values.
Values are formatted by type: numbers by locale, words of the product by the catalogue, user text unchanged.
Sentences without a template are handled by `web/stored_sentences.py` (docs/how-to/languages.md).
"""

from __future__ import annotations

import datetime as dt
import functools
import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from babel import Locale
from babel.messages.pofile import read_po

from sagittal.core.message import PLACEHOLDER, Message, Value, parse_template
from sagittal.core.user_text import UserText
from sagittal.web.message_format import (
    ValueFormat,
    fill_placeholders,
    has_words,
    match_case,
)
from sagittal.web.stored_sentences import SentenceFinder

SOURCE: Final = "en"

TEXTS: Final = Path(__file__).parent / "texts"
EARLIER: Final = TEXTS / "earlier.json"


def name_language(code: str) -> str:
    """Name of a language in the language itself."""
    name = Locale.parse(code).get_display_name() or code
    return name[0].upper() + name[1:]


LANGUAGES: Final[Mapping[str, str]] = {
    code: name_language(code) for code in (SOURCE, *sorted(path.stem for path in TEXTS.glob("*.po")))
}
"""Language code → its own name; the first is that of the sources, the others have catalogues."""


def choose_language(accepted: str | None) -> str:
    """Choose the language of the pages from a browser's Accept-Language.

    >>> choose_language("fr-CH, de-CH;q=0.9, en;q=0.8"), choose_language("de;q=0.2, en")
    ('de', 'en')
    """
    preferences: list[tuple[float, str]] = []
    for part in (accepted or "").split(","):
        tag, _, quality = part.strip().partition(";q=")
        try:
            weight = float(quality or 1)
        except ValueError:
            continue
        preferences.append((-weight, tag.split("-")[0].strip().lower()))
    return next(
        (tag for weight, tag in sorted(preferences, key=lambda a: a[0]) if weight and tag in LANGUAGES),
        SOURCE,
    )


class Catalogue:
    """Translations of one language.

    Parameters
    ----------
    messages : English text with {placeholders} → translation with the same placeholders, or some of them.
    """

    def __init__(self, language: str, messages: Mapping[str, str]) -> None:
        self.language = language
        self.messages = messages
        self._values = ValueFormat(language)

    @functools.cached_property
    def _sentences(self) -> SentenceFinder:
        earlier = {old: self.messages[new] for old, new in read_earlier().items() if new in self.messages}
        return SentenceFinder({**earlier, **self.messages}, self._values)

    def find(self, text: str) -> str | None:
        """Translation of a text; None if the catalogue does not have it.

        Only a sentence that carries no template is compared with the patterns of all messages.
        """
        if isinstance(text, Message):
            return self._render(text)
        said = self.messages.get(text)
        return self._sentences.find(text) if said is None else said

    def translate(self, text: str) -> str:
        """Translation of a text, English if it matches no message."""
        translation = self.find(text)
        return text if translation is None else translation

    def fill(self, message: str, values: Mapping[str, str]) -> str:
        """Translation of a message with translated values; English if the catalogue has none."""
        return fill_placeholders(self.messages.get(message, message), values)

    def day(self, value: dt.date | dt.datetime) -> str:
        """A date as "18.11.2026"."""
        return self._values.day(value)

    def _render(self, message: Message) -> str | None:
        """Translation of a message with its values; None if the catalogue does not contain it."""
        identifier, formats = parse_template(message.template)
        translation = self.messages.get(identifier)
        if translation is None:
            if has_words(identifier):
                return None
            translation = identifier
        values = {name: self._write(message.values[name], spec) for name, spec in formats.items()}
        return match_case(message, fill_placeholders(self._values.mark_quotations(translation), values))

    def _write(self, value: Value, spec: str) -> str:
        """Format a value in this language."""
        if isinstance(value, dt.date) and not spec:
            return self.day(value)
        if isinstance(value, str):
            return str(value) if isinstance(value, UserText) else self.translate(value)
        return format(value, spec).replace(".", self._values.decimal_mark)


def read_messages(path: Path) -> Iterator[tuple[str, str, frozenset[str]]]:
    """Yield message, translation and source files of every translated message of a .po file."""
    with path.open("rb") as file:
        for entry in read_po(file):
            if entry.id and entry.string:
                yield str(entry.id), str(entry.string), frozenset(name for name, _ in entry.locations)


@functools.cache
def read_earlier() -> Mapping[str, str]:
    """Earlier wording of messages → current wording; results of earlier versions hold finished sentences."""
    wordings: dict[str, str] = json.loads(EARLIER.read_text("utf-8"))
    return wordings


def catalogue_path(language: str) -> Path:
    """Path of a language's catalogue."""
    return TEXTS / f"{language}.po"


SCRIPTS: Final = "web/static/js/"

SCRIPT_PLACES: Final = (
    SCRIPTS,
    "core/agreement/tell_live.py",
    "core/calibration/score.py",
    "core/calibration/score_rules.py",
    "core/norms/",
    "core/online/",
    "core/parameters/catalogue/",
    "server/http/",
    "server/live/",
    "server/auth/",
    "server/api/",
    "server/clinic/",
    "server/downloads/",
    "server/errors.py",
    "server/live_takes/",
    "server/results/",
    "server/safekeeping/",
    "server/sharing/",
    "server/uploads/",
    "server/storage/field_cipher.py",
    "server/report/view/calibration_checks.py",
    "server/report/words/change_words.py",
    "server/report/words/guided_words.py",
    "server/report/words/wording.py",
    "server/pages/results/session_context.py",
    "server/pages/words.py",
    "tests/helpers/texts.py",
)
"""Sources of messages that are used in scripts."""


@functools.cache
def script_texts(language: str) -> tuple[str, bytes]:
    """Translations used by scripts as JSON, and their hash for the URL."""
    texts = {
        text: words
        for text, words, files in read_messages(catalogue_path(language))
        if any(name.startswith(SCRIPT_PLACES) for name in files)
    }
    content = json.dumps(texts, ensure_ascii=False, separators=(",", ":")).encode()
    return hashlib.sha256(content).hexdigest()[:16], content


@functools.cache
def load_catalogue(language: str) -> Catalogue:
    """Load the catalogue of a language other than English, cached."""
    return Catalogue(
        language,
        {
            text: translation
            for text, translation, files in read_messages(catalogue_path(language))
            # the sentences of scripts are made in the browser
            if not (PLACEHOLDER.search(text) and all(name.startswith(SCRIPTS) for name in files))
        },
    )
