"""Templates are made into Python once for a folder, and anew when anything of the pages changes."""

from __future__ import annotations

from pathlib import Path

import pytest
from jinja2 import Environment

from server.http import templates
from server.storage.compile_cache import VARIABLE

PAGE = "account.html"


class CompiledError(Exception):
    pass


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in which all templates of a page are, and a process that may make none."""
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    for language in ("en", "de"):
        templates.load_templates(language).env.get_template(PAGE)

    def refuse(*_: object, **__: object) -> None:
        raise CompiledError

    monkeypatch.setattr(Environment, "compile", refuse)
    return tmp_path


@pytest.mark.parametrize("language", ["en", "de"])
def test_the_next_process_makes_none(kept: Path, language: str) -> None:
    templates.load_templates(language).env.get_template(PAGE)
    assert len(list(kept.iterdir())) == 2


@pytest.mark.parametrize("damaged", [b"", b"j2", b"no bytecode of Jinja"])
def test_a_damaged_file_is_made_anew(kept: Path, damaged: bytes) -> None:
    for path in kept.iterdir():
        path.write_bytes(damaged)
    with pytest.raises(CompiledError):
        templates.load_templates("en").env.get_template(PAGE)


def test_other_words_are_other_templates(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(templates, "fingerprint_pages", lambda: "of the next version")
    with pytest.raises(CompiledError):
        templates.load_templates("en").env.get_template(PAGE)


def test_pages_are_shown_where_nothing_can_be_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "not there"))
    templates.load_templates("en").env.get_template(PAGE)
    assert list(tmp_path.iterdir()) == []
