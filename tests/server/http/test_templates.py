"""Templates are compiled once per folder and again after any change of the pages."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from jinja2 import Environment, compiler
from jinja2.bccache import bc_magic

from sagittal.server.http import templates
from sagittal.server.storage.compile_cache import VARIABLE

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


@pytest.mark.parametrize(
    "damaged",
    [b"", b"j2", b"no bytecode of Jinja", bc_magic, bc_magic + b"no checksum", bc_magic + b"\x80\x02X"],
)
def test_a_damaged_file_is_made_anew(kept: Path, damaged: bytes) -> None:
    for path in kept.iterdir():
        path.write_bytes(damaged)
    with pytest.raises(CompiledError):
        templates.load_templates("en").env.get_template(PAGE)


def test_other_words_are_other_templates(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(templates, "fingerprint_pages", lambda: "of the next version")
    with pytest.raises(CompiledError):
        templates.load_templates("en").env.get_template(PAGE)


def test_an_upgrade_below_a_running_process_is_not_mixed_with_what_it_has_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    running = templates.load_templates("en").env
    monkeypatch.setattr(templates, "fingerprint_pages", lambda: "of the next version")
    running.get_template(PAGE)
    result: list[object] = []
    compile_plainly = Environment.compile

    def note(env: Environment, *inputs: Any, **others: Any) -> Any:
        result.append(inputs)
        return compile_plainly(env, *inputs, **others)

    monkeypatch.setattr(Environment, "compile", note)
    templates.load_templates("en").env.get_template(PAGE)
    assert result


def test_what_makes_templates_is_a_part_of_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    initial = templates.fingerprint_pages.__wrapped__()
    for module in (templates, compiler):
        changed = tmp_path / "changed.py"
        changed.write_text(Path(module.__file__ or "").read_text("utf-8") + "\n")
        with monkeypatch.context() as second:
            second.setattr(module, "__file__", str(changed))
            assert templates.fingerprint_pages.__wrapped__() != initial


def test_a_folder_that_is_a_file_keeps_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_bytes(b"")
    monkeypatch.setenv(VARIABLE, str(tmp_path / "file"))
    templates.load_templates("en").env.get_template(PAGE)
    assert (tmp_path / "file").read_bytes() == b""


def test_pages_are_shown_where_nothing_can_be_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "not there"))
    templates.load_templates("en").env.get_template(PAGE)
    assert list(tmp_path.iterdir()) == []
