"""Ownership of requests: live trials belong to the web server with their log, 3D views are assigned by hash.

live take of a session   the server that has the session's newest take while it is open; else that one,
                         while it lives, or the one that the session's id hashes to
film of a take           the server that has the take
3D view                  the server that its id hashes to; pages make ids up before they ask
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final
from urllib.parse import parse_qs

from sqlalchemy import select
from starlette.types import Scope

from sagittal.server.nodes.registry import Nodes, WebNode
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.live_tables import OPEN_TAKE_STATES, live_take

_ID = "([0-9a-f]{32})"
_SESSION: Final = re.compile(
    rf"/sessions/{_ID}/live/(?:feed|figure)|/api/v1/sessions/{_ID}/live(?:/(?:code|commands|close))?"
)
_TAKE: Final = re.compile(rf"/api/v1/live/takes/{_ID}/film(?:/.*)?")
_VIEW: Final = re.compile(rf"/views/{_ID}/?")
_REPLAY: Final = re.compile(rf"/sessions/{_ID}/replay")


@dataclass(frozen=True)
class Pin:
    """The resource a request refers to. kind : session, take or view."""

    kind: str
    id: str


@dataclass(frozen=True)
class Owner:
    """Another web server that owns a resource.

    Parameters
    ----------
    node : None = unavailable. must : no other server can serve the request.
    """

    name: str
    node: WebNode | None
    must: bool


def find_pin(scope: Scope) -> Pin | None:
    """Resource in a path that one particular server must serve; None = any server."""
    path = scope["path"]
    if match := _SESSION.fullmatch(path):
        return Pin("session", match[1] or match[2])
    if match := _TAKE.fullmatch(path):
        return Pin("take", match[1])
    if match := _VIEW.fullmatch(path):
        return Pin("view", match[1])
    if _REPLAY.fullmatch(path):
        names = parse_qs(scope["query_string"].decode("latin-1")).get("view", [""])
        return Pin("view", names[-1]) if re.fullmatch(_ID, names[-1]) else None
    return None


def find_owner(db: Database, nodes: Nodes, pin: Pin) -> Owner | None:
    """The other server that owns a resource, None = this one; blocks."""
    if not nodes.is_one_of_several:
        return None
    if pin.kind == "view":
        return _of_home(nodes, pin.id)
    mine = live_take.c.session_id if pin.kind == "session" else live_take.c.id
    query = select(live_take.c.node, live_take.c.state).where(mine == pin.id)
    with db.read() as c:
        row = c.execute(query.order_by(live_take.c.created_at.desc(), live_take.c.id).limit(1)).first()
    if row is None or row.node is None:
        return _of_home(nodes, pin.id) if pin.kind == "session" else None
    if row.node == nodes.name:
        return None
    node = nodes.find(row.node)
    if pin.kind == "take" or row.state in OPEN_TAKE_STATES:
        return Owner(row.node, node, must=True)
    return _of_home(nodes, pin.id) if node is None else Owner(row.node, node, must=False)


def _of_home(nodes: Nodes, word: str) -> Owner | None:
    home = nodes.find_home(word)
    return None if home is None else Owner(home.name, home, must=False)
