"""Page frame: navigation, running jobs and permissions; and audit of access."""

from __future__ import annotations

from fastapi import Request
from starlette.responses import Response

from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import jobs
from sagittal.server.context import state_of
from sagittal.server.http.templates import render
from sagittal.server.provenance import CODE_VERSION
from sagittal.server.storage.db import Database

NAVIGATION = (
    ("patients", "people", "Patients", "/patients", Action.READ_PATIENT),
    ("jobs", "jobs", "Jobs", "/jobs", Action.READ_JOB),
    ("devices", "sensor", "Sensors", "/sensors", Action.READ_DEVICE),
    ("users", "users", "Users", "/users", Action.MANAGE_USERS),
    ("audit", "audit", "Audit", "/audit", Action.READ_AUDIT),
    ("system", "gear", "System", "/system", Action.READ_SYSTEM),
)
"""Navigation entries: page, icon, label, URL, and required action."""


FRAGMENT = "x-sagittal-fragment"
"""Header with which a page's own script requests part of it."""


def record_opening(request: Request, user: Identity, resource: str, resource_id: str) -> None:
    """Record access to a resource in the audit log."""
    state_of(request).trail.record_opened(user, f"{resource}.opened", resource, resource_id)


def record_listing(request: Request, user: Identity, resource: str) -> None:
    """Record access to a list in the audit log."""
    state_of(request).trail.record_watched(user, f"{resource}.listed", resource, None)


def render_page(
    request: Request,
    db: Database,
    user: Identity,
    template: str,
    section: str,
    /,
    running: int | None = None,
    **context: object,
) -> Response:
    """Render a page.

    Parameters
    ----------
    section : its entry in the navigation. running : `jobs.count_active`, if already known.
    """
    if running is None:
        running = jobs.count_active(db, user)
    return render_sheets(request, user, template, nav=NAVIGATION, here=section, running=running, **context)


def render_sheets(request: Request, user: Identity, template: str, /, **context: object) -> Response:
    """Render printed pages without navigation."""
    shell = {
        "signed_in": user.name,
        "version": CODE_VERSION,
        "may": lambda action: user.may(Action(action)),
    }
    return render(request, template, shell | context)
