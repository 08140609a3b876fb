"""Event log of a live trial: commands and their values, cues, notices, damage of its log."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import Connection, bindparam, insert, select

from sagittal.core.errors import ParameterError
from sagittal.core.message import Message
from sagittal.core.signals.recording import GivenLimits
from sagittal.server import audit
from sagittal.server.errors import ServiceError
from sagittal.server.storage.schema.live_tables import live_event, live_take
from sagittal.server.storage.schema.tables import now, user

DAMAGED = "live_log_damaged"
"""Code of the notice that part of a trial's log could not be read."""

COMMANDS = (
    "start", "stop", "mark", "undo_mark", "feedback", "level", "pause", "redo_calibration", "ghost", "test",
)  # fmt: skip
"""Commands of a therapist in a running trial, stored as events."""


@dataclass(frozen=True)
class LiveEvent:
    """An event of a live trial: a command, cue, calibration, notice or change of state."""

    seq: int
    take_id: str
    kind: str
    t_s: float | None
    content: Mapping[str, Any]
    by: str | None
    at: dt.datetime


def check_value(name: str, value: object) -> None:
    """Validate a command's value; raises ServiceError bad_value."""
    if name in ("feedback", "pause"):
        ok, expected = isinstance(value, bool), "true or false"
    elif name == "level":
        ok = isinstance(value, int) and not isinstance(value, bool) and abs(value) <= 100
        expected = "a whole number of steps, + easier, − harder"
    elif name in ("mark", "ghost"):
        ok = value is None or (isinstance(value, str) and len(value) <= 200)
        expected = "a short text or nothing"
    elif name == "test":
        ok, expected = value in ("go", "repeat") or _are_limits(value), "go, repeat, or start_s and end_s"
    else:
        ok, expected = value is None, "nothing"
    if not ok:
        raise ServiceError(
            "bad_value",
            Message("The value of the command {name} is not {expected}.", name=name, expected=expected),
        )


def _are_limits(value: object) -> bool:
    """Whether these are start and end of a functional test."""
    if not isinstance(value, Mapping) or set(value) != {"start_s", "end_s"}:
        return False
    try:
        limits = GivenLimits(value["start_s"], value["end_s"])
    except (ParameterError, TypeError):
        return False
    return limits.start_s is not None and limits.end_s is not None


def read_test_limits(c: Connection, take_id: str) -> dict[str, float] | None:
    """Latest start and end set for the functional test of a trial; cleared by a repetition."""
    limits = [e.content["value"] for e in events(c, take_id) if e.kind == "test"]
    last = limits[-1] if limits else None
    return dict(last) if isinstance(last, Mapping) else None


def add_event(
    c: Connection, actor: audit.Actor | None, take_id: str, kind: str, t_s: float | None, content: object
) -> int:
    """Append an event and return its number."""
    row = {
        "take_id": take_id,
        "kind": kind,
        "t_s": t_s,
        "content": content,
        "user_id": actor.user_id if actor else None,
        "at": now(),
    }
    key = c.execute(insert(live_event).values(row)).inserted_primary_key
    if key is None:
        raise RuntimeError("the database gave no number to an event")
    return int(key[0])


def events(c: Connection, take_id: str) -> list[LiveEvent]:
    """All events of a trial, in order."""
    query = (
        select(*_EVENT_COLUMNS, user.c.display_name.label("by"))
        .join(user, user.c.id == live_event.c.user_id, isouter=True)
        .where(live_event.c.take_id == take_id)
        .order_by(live_event.c.seq)
    )
    return [LiveEvent(**row._asdict()) for row in c.execute(query)]


def own_notice(code: str, text: str) -> dict[str, str]:
    """Content of a notice issued by the server itself rather than the estimator."""
    return {"code": code, "text": text, "severity": "bad", "from": "server"}


def is_own_notice(content: Mapping[str, Any]) -> bool:
    """Whether an event's content was created by `own_notice`."""
    return content.get("from") == "server"


def list_damages(c: Connection, session_id: str) -> list[str]:
    """Losses in a session's live trials due to damaged logs, as sentences."""
    return list(c.execute(_DAMAGES, {"of_session": session_id}).scalars())


_EVENT_COLUMNS = tuple(live_event.c[name] for name in LiveEvent.__dataclass_fields__ if name in live_event.c)


_DAMAGES: Final = (
    select(live_event.c.content["text"].as_string())
    .join(live_take, live_take.c.id == live_event.c.take_id)
    .where(
        live_take.c.session_id == bindparam("of_session"),
        live_event.c.kind == "notice",
        live_event.c.content["code"].as_string() == DAMAGED,
    )
    .order_by(live_event.c.seq)
)
