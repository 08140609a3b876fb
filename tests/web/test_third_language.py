"""One .po file makes a language: proved with a pseudo-locale of longer texts between right-to-left marks."""

from __future__ import annotations

import html
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest
from babel.messages.catalog import Catalog
from babel.messages.pofile import write_po

from sagittal.core.message import PLACEHOLDER, Message
from sagittal.server.auth.roles import Role
from sagittal.server.http import templates
from sagittal.web import language as languages
from sagittal.web.language import LANGUAGES, Catalogue, catalogue_path, load_catalogue, read_messages
from sagittal.web.message_format import has_words
from tests.helpers.clinic import open_clinic
from tests.web.test_language import TEMPLATES

pytestmark = pytest.mark.anyio

CODE: Final = "fa"
"""A language that is written from right to left, with a decimal mark of its own."""

RIGHT_TO_LEFT: Final = "\u200f"

LONGER: Final = 0.5
"""Share by which texts of the pseudo-locale are longer than English ones."""

ACCOUNT: Final = "admin"
"""Name of the account that reads the pages: user text, and a word of the product as well."""

PAGES: Final = ("/patients", "/jobs", "/account", "/sensors", "/users")


def make_pseudo(text: str) -> str:
    """A text that is longer, between right-to-left marks."""
    return (
        f"{RIGHT_TO_LEFT}{text}{'~' * max(1, round(LONGER * len(PLACEHOLDER.sub('', text))))}{RIGHT_TO_LEFT}"
    )


@pytest.fixture
def pseudo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Catalogue]:
    """The pseudo-locale as a language of the installation."""
    german = catalogue_path("de")
    catalog = Catalog(locale=CODE)
    for message, _, files in read_messages(german):
        catalog.add(message, make_pseudo(message), locations=[(name, 1) for name in sorted(files)])
    texts = tmp_path / "texts"
    texts.mkdir()
    with (texts / f"{CODE}.po").open("wb") as file:
        write_po(file, catalog)
    monkeypatch.setattr(languages, "TEXTS", texts)
    monkeypatch.setitem(LANGUAGES, CODE, languages.name_language(CODE))
    load_catalogue.cache_clear()
    languages.script_texts.cache_clear()
    monkeypatch.setitem(templates.TEMPLATES, CODE, templates.load_templates(CODE))
    yield load_catalogue(CODE)
    load_catalogue.cache_clear()
    languages.script_texts.cache_clear()


def test_a_language_is_named_by_its_locale(pseudo: Catalogue) -> None:
    assert LANGUAGES[CODE] == "فارسی"
    assert LANGUAGES["de"] == "Deutsch"


def test_every_message_is_in_the_third_language(pseudo: Catalogue) -> None:
    known = {template for _, template in TEMPLATES if template in pseudo.messages}
    assert len(known) > 200
    for template in known:
        message = Message(template, **dict.fromkeys(PLACEHOLDER.findall(template), 7.5))
        text = pseudo.translate(message)
        assert text.startswith(RIGHT_TO_LEFT)
        assert len(text) > len(message)
        assert not PLACEHOLDER.search(text)


def list_words(page: str) -> list[str]:
    """Words that a page shows, without its scripts and drawings."""
    body = re.sub(r"(?s)<(script|style|svg|template)\b.*?</\1>|<!--.*?-->", " ", page)
    shown = [html.unescape(text).strip() for text in re.findall(r">([^<>]+)<", body)]
    return [text for text in shown if has_words(text)]


async def test_pages_are_in_the_third_language(pseudo: Catalogue, tmp_path: Path) -> None:
    async with open_clinic(tmp_path) as clinic, clinic.client(Role.ADMIN) as client:
        client.headers["accept-language"] = CODE
        for path in PAGES:
            answer = await client.get(path, headers={"accept": "text/html"})
            assert answer.status_code == 200
            assert f'<html lang="{CODE}"' in answer.text
            words = list_words(answer.text)
            english = [text for text in words if text in pseudo.messages and text != ACCOUNT]
            assert sum(RIGHT_TO_LEFT in text for text in words) > 0.8 * len(words), words
            assert english == []
