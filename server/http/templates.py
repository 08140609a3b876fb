"""The templates of web/templates, with the filters and the words that all of them use."""

from __future__ import annotations

from pathlib import Path

from starlette.templating import Jinja2Templates

import web
from core.body.model import NOMINAL_HEIGHT_M
from core.condition import CHOICES
from web.words import FILTERS


def load_templates() -> Jinja2Templates:
    """Return the environment in which every page is rendered."""
    templates = Jinja2Templates(Path(web.__file__).parent / "templates")
    templates.env.filters.update(FILTERS)
    templates.env.globals["conditions"] = CHOICES
    templates.env.globals["ASSUMED_HEIGHT"] = f"{NOMINAL_HEIGHT_M:.2f} m"
    return templates


TEMPLATES = load_templates()
