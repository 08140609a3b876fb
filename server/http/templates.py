"""Jinja environments of web/templates, one per language, with shared filters and terms."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Mapping, MutableMapping
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from fastapi import Request
from jinja2 import Environment, FileSystemBytecodeCache, FileSystemLoader, compiler
from jinja2.bccache import Bucket
from starlette.requests import HTTPConnection
from starlette.responses import Response
from starlette.templating import Jinja2Templates

from sagittal import web
from sagittal.core.body.model import NOMINAL_HEIGHT_M
from sagittal.core.plurals import plural
from sagittal.core.subject.condition import CHOICES
from sagittal.server.storage.compile_cache import VARIABLE
from sagittal.web.language import LANGUAGES, SOURCE, choose_language, load_catalogue, script_texts
from sagittal.web.shown import Shown
from sagittal.web.template_texts import speak_template
from sagittal.web.words import FILTERS

FOLDER: Final = Path(web.__file__).parent


class FlushLeftLoader(FileSystemLoader):
    """Loads templates without their indentation, which accounts for a seventh of a page."""

    def get_source(self, environment: Environment, template: str) -> tuple[str, str, Callable[[], bool]]:
        """Return source, file and up-to-date check; line numbers are preserved."""
        source, name, is_newest = super().get_source(environment, template)
        return re.sub(r"\n[ \t]+", "\n", source), name, is_newest


class SpokenLoader(FlushLeftLoader):
    """Loads templates with all text replaced by look-ups in a language's catalogue."""

    def get_source(self, environment: Environment, template: str) -> tuple[str, str, Callable[[], bool]]:
        """Return source, file and up-to-date check."""
        source, name, is_newest = super().get_source(environment, template)
        return speak_template(source), name, is_newest


@cache
def fingerprint_pages() -> str:
    """Digest of everything that determines the compiled templates, including the code that compiles them."""
    digest = hashlib.sha256()
    for path in (Path(__file__), Path(compiler.__file__), *sorted(FOLDER.rglob("*"))):
        if path.is_file() and path.suffix != ".pyc":
            digest.update(path.read_bytes())
    return digest.hexdigest()


class KeptBytecode(FileSystemBytecodeCache):
    """Cache of compiled templates of one language, in the folder of compiled filters.

    Compiling takes a third of the time of a process's first page. If the folder is not writable, each process
    compiles its own.
    """

    def __init__(self, language: str) -> None:
        super().__init__(os.environ[VARIABLE], f"{language}_%s.template")
        # at start: after an upgrade during operation the files no longer match the loaded ones
        self._pages = fingerprint_pages()

    def get_source_checksum(self, source: str) -> str:
        """Digest of a template and of the terms, texts and file addresses that are inlined in it."""
        return hashlib.sha256(f"{self._pages}{source}".encode()).hexdigest()

    def load_bytecode(self, bucket: Bucket) -> None:
        """Read the bytecode cached by an earlier process; an unreadable file counts as missing."""
        try:
            super().load_bytecode(bucket)
        except Exception:  # noqa: BLE001  # a damaged pickle raises anything
            bucket.reset()

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Cache a template for later processes."""
        with suppress(OSError):
            super().dump_bytecode(bucket)


class SettledEnvironment(Environment):
    """Environment whose globals are complete before the first template is loaded.

    By default Jinja keeps the globals of templates and environment apart and compares them name by name at
    every import, which takes a fifteenth of the rendering time of a page.
    """

    def make_globals(self, d: MutableMapping[str, Any] | None) -> MutableMapping[str, Any]:
        """Return the globals of a template merged with those of the environment."""
        return {**self.globals, **(d or {})}


def load_templates(language: str) -> Jinja2Templates:
    """Return the environment for rendering pages in a language."""
    folder = FOLDER / "templates"
    is_source = language == SOURCE
    loader = FlushLeftLoader(folder) if is_source else SpokenLoader(folder)
    bytecode = KeptBytecode(language) if VARIABLE in os.environ else None
    templates = Jinja2Templates(
        env=SettledEnvironment(loader=loader, autoescape=True, bytecode_cache=bytecode),
    )
    templates.env.filters.update(FILTERS)
    templates.env.policies["json.dumps_kwargs"] = {"sort_keys": True, "separators": (",", ":")}
    if not is_source:
        display = Shown(load_catalogue(language))
        templates.env.filters.update(display.filters)
        templates.env.globals.update(display.functions)
        templates.env.globals["script_texts"] = f"/texts/{language}/{script_texts(language)[0]}.json"
    templates.env.globals["conditions"] = CHOICES
    templates.env.globals["plural"] = plural
    templates.env.globals["languages"] = LANGUAGES
    templates.env.globals["language"] = language
    templates.env.globals["makes_pdf"] = find_spec("weasyprint") is not None
    templates.env.globals["ASSUMED_HEIGHT"] = f"{NOMINAL_HEIGHT_M:.2f} m"
    return templates


TEMPLATES: Final[Mapping[str, Jinja2Templates]] = {
    language: load_templates(language) for language in LANGUAGES
}


def language_of(connection: HTTPConnection) -> str:
    """Language chosen by the signed-in user, otherwise the browser's."""
    chosen = getattr(connection.state, "language", None)
    return chosen or choose_language(connection.headers.get("accept-language"))


def render(
    request: Request, template: str, context: Mapping[str, Any], status_code: int = 200, **options: Any
) -> Response:
    """Render a page in the language of the user."""
    templates = TEMPLATES[language_of(request)]
    return templates.TemplateResponse(request, template, dict(context), status_code=status_code, **options)
