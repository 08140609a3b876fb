"""The templates of web/templates, with the filters and the words that all of them use."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from jinja2 import Environment, FileSystemLoader
from starlette.templating import Jinja2Templates

import web
from core.body.model import NOMINAL_HEIGHT_M
from core.condition import CHOICES
from web.words import FILTERS


class FlushLeftLoader(FileSystemLoader):
    """Templates without their indentation, which is for those who read them and a seventh of a page."""

    def get_source(self, environment: Environment, template: str) -> tuple[str, str, Callable[[], bool]]:
        """Return source, file and whether it is still the newest; every line keeps its number."""
        source, name, is_newest = super().get_source(environment, template)
        return re.sub(r"\n[ \t]+", "\n", source), name, is_newest


def load_templates() -> Jinja2Templates:
    """Return the environment in which every page is rendered."""
    folder = Path(web.__file__).parent / "templates"
    templates = Jinja2Templates(env=Environment(loader=FlushLeftLoader(folder), autoescape=True))
    templates.env.filters.update(FILTERS)
    templates.env.globals["conditions"] = CHOICES
    templates.env.globals["ASSUMED_HEIGHT"] = f"{NOMINAL_HEIGHT_M:.2f} m"
    return templates


TEMPLATES = load_templates()
