"""A message is looked up by its template, and each value is written as its type asks."""

from __future__ import annotations

import ast
import datetime as dt
import timeit
from typing import Final

import pytest

from sagittal.core.message import PLACEHOLDER, Message, join_messages
from sagittal.core.user_text import UserText
from sagittal.web.language import LANGUAGES, SOURCE, Catalogue, load_catalogue, read_earlier
from sagittal.web.stored_sentences import SentenceFinder
from tests.data import ROOT
from tests.helpers.texts import STAYS_ENGLISH, messages_of

OTHERS: Final = [language for language in LANGUAGES if language != SOURCE]

MESSAGES: Final = {
    "The clock of {sensor} is {ms} ms late.": "Die Uhr ({sensor}) geht {ms} ms nach.",
    "Since {day}: {cause}": "Seit {day}: {cause}",
    "{n} strides of “{title}”": "{n} Doppelschritte von “{title}”",
    "left foot": "Fuß links",
}

SLOWEST_US: Final = 20.0
"""µs that a lookup may cost."""


@pytest.fixture
def german(monkeypatch: pytest.MonkeyPatch) -> Catalogue:
    """A small catalogue that refuses to guess a sentence."""

    def refuse(_: SentenceFinder, text: str) -> str | None:
        raise AssertionError(text)

    monkeypatch.setattr(SentenceFinder, "find", refuse)
    return Catalogue("de", MESSAGES)


def test_a_message_is_looked_up_by_its_template(german: Catalogue) -> None:
    late = Message("The clock of {sensor} is {ms:.1f} ms late.", sensor="left foot", ms=1.55)
    assert german.translate(late) == "Die Uhr (Fuß links) geht 1,6 ms nach."


def test_values_are_written_as_their_types_ask(german: Catalogue) -> None:
    late = Message("The clock of {sensor} is {ms:.1f} ms late.", sensor="left foot", ms=2)
    since = Message("Since {day}: {cause}", day=dt.date(2026, 11, 18), cause=late)
    assert german.translate(since) == "Seit 18.11.2026: Die Uhr (Fuß links) geht 2,0 ms nach."
    typed = Message("{n} strides of “{title}”", n=2.5, title="left foot")
    assert german.translate(typed) == "2,5 Doppelschritte von „left foot“"
    named = Message("The clock of {sensor} is {ms:g} ms late.", sensor=UserText("left foot"), ms=2)
    assert german.translate(named) == "Die Uhr (left foot) geht 2 ms nach."


def test_joined_messages_need_no_text_of_their_own(german: Catalogue) -> None:
    late = Message("The clock of {sensor} is {ms:.0f} ms late.", sensor="left foot", ms=2)
    assert german.translate(join_messages(late, late)) == " ".join(
        ["Die Uhr (Fuß links) geht 2 ms nach."] * 2
    )


def test_a_template_that_is_not_there_stays_english(german: Catalogue) -> None:
    second = Message("The clock of {who} is {ms:.1f} ms late.", who="left foot", ms=1.5)
    assert german.find(second) is None
    assert german.translate(second) == second


def test_a_sentence_stored_without_its_template_is_guessed() -> None:
    stored = "The clock of left foot is 1.5 ms late."
    assert Catalogue("de", MESSAGES).translate(stored) == "Die Uhr (Fuß links) geht 1,5 ms nach."


def list_templates() -> list[tuple[str, str]]:
    """File and identifier of every message that the sources make of a literal template."""
    silent = tuple(f"{place}" for place in STAYS_ENGLISH)
    return [
        (name, identifier)
        for part in ("core", "server")
        for path in sorted((ROOT / part).rglob("*.py"))
        if not (name := path.relative_to(ROOT).as_posix()).startswith(silent)
        for call in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "Message"
        if not isinstance(call.args[0], ast.Name)
        for identifier in messages_of(call.args[0])
    ]


TEMPLATES: Final = list_templates()


@pytest.mark.parametrize("language", OTHERS)
def test_no_message_of_the_sources_is_guessed(language: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those for programmers (a parameter out of its domain) have no text and stay English."""
    catalogue = load_catalogue(language)
    guessed: list[str] = []
    monkeypatch.setattr(SentenceFinder, "find", lambda _, text: guessed.append(text))
    reference = {t for _, t in TEMPLATES if t in catalogue.messages}
    assert len(reference) > 200
    for template in reference:
        message = Message(template, **dict.fromkeys(PLACEHOLDER.findall(template), 7))
        text = catalogue.find(message)
        assert text is not None
        assert not PLACEHOLDER.search(text)
    assert guessed == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_lookup_is_fast(language: str) -> None:
    catalogue = Catalogue(language, MESSAGES) if language == SOURCE else load_catalogue(language)
    template = next(
        t for _, t in TEMPLATES if len(PLACEHOLDER.findall(t)) > 3 and t in load_catalogue("de").messages
    )
    message = Message(template, **dict.fromkeys(PLACEHOLDER.findall(template), 7.25))
    catalogue.translate(message)
    best = min(timeit.repeat(lambda: catalogue.translate(message), number=200, repeat=5)) / 200
    assert 1e6 * best < SLOWEST_US


@pytest.mark.parametrize(
    ("stored", "translation"),
    [
        ("shank_l has no data in 56 % of the take.", "shank_l hat in 56 % der Aufnahme keine Daten."),
        ("not reported: not physiologically plausible", "zurückgehalten: so kann niemand gehen"),
    ],
)
def test_sentences_of_earlier_versions_are_still_translated(stored: str, translation: str) -> None:
    assert load_catalogue("de").translate(stored) == translation


def test_earlier_wordings_lead_to_messages_of_today() -> None:
    earlier, messages = read_earlier(), load_catalogue("de").messages
    assert [new for new in earlier.values() if new not in messages] == []
    assert [old for old in earlier if old in messages] == []
