"""What every page has around it: navigation, running jobs, who may do what; and the audit row of opening."""

from __future__ import annotations

from fastapi import Request
from starlette.responses import Response

from server import audit, page_views
from server.auth.identity import Identity
from server.auth.roles import Action
from server.problems import TEMPLATES
from server.services.provenance import CODE_VERSION
from server.storage.db import Database
from web.words import FILTERS

TEMPLATES.env.filters.update(FILTERS)

NAVIGATION = (
    ("patients", "people", "Patients", "/patients", Action.READ_PATIENT),
    ("jobs", "jobs", "Jobs", "/jobs", Action.READ_JOB),
    ("users", "users", "Users", "/users", Action.MANAGE_USERS),
    ("audit", "audit", "Audit", "/audit", Action.READ_AUDIT),
)
"""Rail entries: page, icon, word, address, and what one must be allowed to do to see it."""


def opened(db: Database, who: Identity, resource: str, resource_id: str) -> None:
    """Write down that somebody looked at it."""
    with db.write() as c:
        audit.record(c, who, f"{resource}.opened", resource, resource_id)


def page(
    request: Request, db: Database, who: Identity, template: str, here: str, **context: object
) -> Response:
    """Render a page; `here` = its entry in the navigation."""
    with db.read() as c:
        running = page_views.running_jobs(c)
    shell = {
        "nav": NAVIGATION,
        "here": here,
        "running": running,
        "version": CODE_VERSION,
        "may": lambda action: who.may(Action(action)),
    }
    return TEMPLATES.TemplateResponse(request, template, shell | context)
