"""State of the installation: components, backups, end of the audit log."""

from __future__ import annotations

import datetime as dt
from typing import Annotated, Any, Final

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from sqlalchemy import Connection
from starlette.responses import Response

from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients
from sagittal.server.clinic.calendar_days import move_years
from sagittal.server.clinic.patients import Patient
from sagittal.server.context import Config, Db, state_of
from sagittal.server.nodes.registry import Nodes, WebNode
from sagittal.server.pages.shell import render_page
from sagittal.server.safekeeping import backup_schedule
from sagittal.server.safekeeping.backup_schedule import BackupState, Outcome
from sagittal.server.storage.high_water import read_newest
from sagittal.server.storage.schema.tables import now

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

PART_WORDS: Final = {
    "database": "Database",
    "files": "Stored files",
    "schema": "Database schema",
    "disk": "Free disk space",
    "workers": "Workers",
    "estimators": "Live estimators",
    "node": "This web server within the cluster",
}


@router.get("/system")
def show_system(
    request: Request, db: Db, settings: Config, user: Annotated[Identity, require(Action.READ_SYSTEM)]
) -> Response:
    """State of components, backups and restore tests, and latest row of the audit log."""
    checks = state_of(request).readiness.checks()
    with db.read() as c:
        head = read_newest(c)
        overdue = _list_overdue(c, settings.retention_years)
    parts = [(PART_WORDS[name], None if message == "ok" else message) for name, message in checks.items()]
    state = backup_schedule.read_state(settings)
    nodes = state_of(request).nodes
    upcoming = backup_schedule.next_time(settings, dt.datetime.now().astimezone())
    return render_page(
        request, db, user, "system.html", "system",
        parts=parts, head=head, folder=settings.backup_dir, encrypted=bool(settings.backup_key),
        backups=describe_backups(state, now()), upcoming=upcoming,
        nodes=_describe_nodes(nodes, now()), years=settings.retention_years, overdue=overdue,
    )  # fmt: skip


def _describe_nodes(nodes: Nodes, time: dt.datetime) -> list[tuple[WebNode, bool]]:
    """All web servers and their availability; empty for a single server."""
    if not nodes.is_one_of_several:
        return []
    return [(node, nodes.is_living(node, time)) for node in nodes.list_all()]


def _list_overdue(c: Connection, years: int) -> list[Patient]:
    """Patients without a visit for this many years; 0 = none."""
    if not years:
        return []
    return patients.list_older(c, move_years(now().date(), -years))


def describe_backups(state: BackupState, time: dt.datetime) -> list[dict[str, Any]]:
    """Table rows for the last backup and restore test, with their state."""
    return [
        _describe("Last backup", state.backup, time, backup_schedule.LATE),
        _describe("Last restore test", state.test, time, backup_schedule.TEST_EVERY + backup_schedule.LATE),
    ]


def _describe(title: str, outcome: Outcome | None, time: dt.datetime, late: dt.timedelta) -> dict[str, Any]:
    if outcome is None:
        return {"what": title, "kind": "warn", "word": "none yet", "found": None}
    if outcome.ok is None:
        kind, word = "warn", "not tested"
    elif not outcome.ok:
        kind, word = "bad", "failed"
    else:
        kind, word = ("warn", "late") if time - outcome.at > late else ("ok", "good")
    return {"what": title, "kind": kind, "word": word, "found": outcome}
