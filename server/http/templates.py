"""The templates of web/templates, with the filters and the words that all of them use, in every language."""

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
    """Templates without their indentation, which is for those who read them and a seventh of a page."""

    def get_source(self, environment: Environment, template: str) -> tuple[str, str, Callable[[], bool]]:
        """Return source, file and whether it is still the newest; every line keeps its number."""
        source, name, is_newest = super().get_source(environment, template)
        return re.sub(r"\n[ \t]+", "\n", source), name, is_newest


class SpokenLoader(FlushLeftLoader):
    """The same templates, every text of which asks the catalogue of a language."""

    def get_source(self, environment: Environment, template: str) -> tuple[str, str, Callable[[], bool]]:
        """Return source, file and whether it is still the newest."""
        source, name, is_newest = super().get_source(environment, template)
        return speak_template(source), name, is_newest


@cache
def fingerprint_pages() -> str:
    """Digest of all that pages are made of, and of what makes Python of them."""
    digest = hashlib.sha256()
    for path in (Path(__file__), Path(compiler.__file__), *sorted(FOLDER.rglob("*"))):
        if path.is_file() and path.suffix != ".pyc":
            digest.update(path.read_bytes())
    return digest.hexdigest()


class KeptBytecode(FileSystemBytecodeCache):
    """What the templates of a language are in Python, kept in the folder of compiled filters.

    To make it is a third of the first page of a process. Where nothing can be written, every process does.
    """

    def __init__(self, language: str) -> None:
        super().__init__(os.environ[VARIABLE], f"{language}_%s.template")
        # now: after an upgrade below a running process the files are no longer those that it has read
        self._pages = fingerprint_pages()

    def get_source_checksum(self, source: str) -> str:
        """Of a template and of what is worked out with it: words, texts, addresses of files."""
        return hashlib.sha256(f"{self._pages}{source}".encode()).hexdigest()

    def load_bytecode(self, bucket: Bucket) -> None:
        """Read what an earlier process has kept; a file that cannot be read is none."""
        try:
            super().load_bytecode(bucket)
        except Exception:  # noqa: BLE001  # a damaged pickle raises anything
            bucket.reset()

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Keep a template for the next process."""
        with suppress(OSError):
            super().dump_bytecode(bucket)


class SettledEnvironment(Environment):
    """An environment whose globals all stand before the first template is loaded.

    Jinja keeps those of a template and of the environment apart, and finds in every import of a page anew,
    name by name, that they are the same: a fifteenth of a page.
    """

    def make_globals(self, d: MutableMapping[str, Any] | None) -> MutableMapping[str, Any]:
        """Return the globals of a template: those of all and its own."""
        return {**self.globals, **(d or {})}


def load_templates(language: str) -> Jinja2Templates:
    """Return the environment in which every page of a language is rendered."""
    folder = FOLDER / "templates"
    is_source = language == SOURCE
    loader = FlushLeftLoader(folder) if is_source else SpokenLoader(folder)
    kept = KeptBytecode(language) if VARIABLE in os.environ else None
    templates = Jinja2Templates(
        env=SettledEnvironment(loader=loader, autoescape=True, bytecode_cache=kept),
    )
    templates.env.filters.update(FILTERS)
    templates.env.policies["json.dumps_kwargs"] = {"sort_keys": True, "separators": (",", ":")}
    if not is_source:
        shown = Shown(load_catalogue(language))
        templates.env.filters.update(shown.filters)
        templates.env.globals.update(shown.functions)
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
    """The language that who is signed in has chosen, else the browser's."""
    chosen = getattr(connection.state, "language", None)
    return chosen or choose_language(connection.headers.get("accept-language"))


def render(
    request: Request, template: str, context: Mapping[str, Any], status_code: int = 200, **others: Any
) -> Response:
    """Render a page in the language of who asks."""
    templates = TEMPLATES[language_of(request)]
    return templates.TemplateResponse(request, template, dict(context), status_code=status_code, **others)
