"""Registry of the web servers of one database; each has a name and a heartbeat.

nodes = Nodes(settings, db, when_fenced); nodes.start(); ...; nodes.stop()
nodes.find_home(word)        # None = here; all servers agree while the same ones are alive

A server without a name runs alone: it has no row and no heartbeat, and owns everything.
"""

from __future__ import annotations

import datetime as dt
import hashlib
import logging
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import delete, func, insert, select, update
from sqlalchemy.exc import SQLAlchemyError

from sagittal.server.nodes.passage import read_key, write_line
from sagittal.server.safekeeping.custody import StrangersError
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.live_tables import live_take
from sagittal.server.storage.schema.node_tables import web_node
from sagittal.server.storage.schema.tables import now

FORGOTTEN: Final = dt.timedelta(days=30)
"""Servers without a heartbeat for this long are no longer listed."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class WebNode:
    """A web server.

    Parameters
    ----------
    address : for the other servers. key_sha256 : hash of its key. run : number of its start.
    beat_at : last heartbeat, None = stopped.
    """

    name: str
    address: str
    key_sha256: str
    run: int
    started_at: dt.datetime
    beat_at: dt.datetime | None


class Nodes:
    """This web server and its peers.

    Parameters
    ----------
    when_fenced : called in a thread when another process has taken over this one's name, which must then end.
    """

    def __init__(self, settings: Settings, db: Database, when_fenced: Callable[[], None]) -> None:
        self._db, self._when_fenced = db, when_fenced
        self._address, self._lease_s = settings.node_address, settings.lease_s
        self.name: str | None = settings.node_name or None
        self.run: int | None = None
        self.key = b""
        self._key_file = settings.node_key
        self._beaten_at = time.monotonic()
        self._others: dict[str, WebNode] = {}
        self._suspected: dict[str, dt.datetime | None] = {}
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._beat_for_ever, name="node-heartbeat", daemon=True)

    def start(self) -> None:
        """Register this server and start its heartbeat; blocks. Raises StrangersError."""
        if self.name is None:
            return
        self.key = read_key(self._key_file)
        time = now()
        with self._db.write() as c:
            mine = web_node.c.name == self.name
            last_run = c.execute(select(web_node.c.run).where(mine)).scalar()
            claimed = select(func.max(live_take.c.node_run)).where(live_take.c.node == self.name)
            self.run = max(last_run or 0, c.execute(claimed).scalar() or 0) + 1
            heard = func.coalesce(web_node.c.beat_at, web_node.c.started_at)
            c.execute(delete(web_node).where(web_node.c.name != self.name, heard < time - FORGOTTEN))
            values = {
                "address": self._address,
                "key_sha256": hashlib.sha256(self.key).hexdigest(),
                "run": self.run,
                "started_at": time,
                "beat_at": time,
            }
            if last_run is None:
                c.execute(insert(web_node).values(name=self.name, **values))
            else:
                c.execute(update(web_node).where(mine).values(**values))
        self._look()
        try:
            self.refuse_strangers()
        except StrangersError:
            self._write_beat(None)
            raise
        self._thread.start()

    def refuse_strangers(self) -> None:
        """Raise StrangersError if the data folder differs from that of the other live servers; blocks."""
        if self.name is None:
            return
        mine, time = hashlib.sha256(read_key(self._key_file)).hexdigest(), now()
        strangers = [
            peer.name
            for peer in self.list_all()
            if peer.name != self.name and peer.key_sha256 != mine and self.is_living(peer, time)
        ]
        if strangers:
            raise StrangersError(
                f"{self._key_file.parent} is not the folder of the web servers on this database "
                f"({', '.join(strangers)}). Share their data folder with this computer and name it by --data."
            )

    def stop(self) -> None:
        """Mark this server as stopped; blocks."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
            try:
                self._write_beat(None)
            except SQLAlchemyError:
                log.warning("that this node has stopped could not be written; the others will notice")

    @property
    def is_one_of_several(self) -> bool:
        """Whether this server has a name."""
        return self.name is not None

    def find(self, name: str) -> WebNode | None:
        """Another server by name, None if unknown or unavailable."""
        peer = self._others.get(name)
        return peer if peer is not None and self.is_living(peer, now()) else None

    def find_home(self, word: str) -> WebNode | None:
        """Server assigned to an unowned resource by hashing its id; None = here."""
        time = now()
        living = [peer for peer in self._others.values() if self.is_living(peer, time)]
        home = max((peer.name for peer in living), key=lambda name: _weigh(name, word), default=None)
        if home is None or self.name is None or _weigh(self.name, word) > _weigh(home, word):
            return None
        return self._others[home]

    def make_id_here(self, make: Callable[[], str]) -> str:
        """A new id that is assigned to this server."""
        while True:
            candidate = make()
            if self.find_home(candidate) is None:
                return candidate

    def write_line(self, peer: WebNode, scope: Mapping[str, Any]) -> bytes:
        """Header that authenticates a forwarded request (server/nodes/passage.py)."""
        return write_line(self.key, self.name or "", peer.name, scope)

    def suspect(self, peer: WebNode) -> None:
        """Treat an unreachable server as unavailable until its next heartbeat."""
        self._suspected[peer.name] = peer.beat_at

    def is_living(self, node: WebNode, time: dt.datetime) -> bool:
        """Whether a server has a recent heartbeat and is reachable."""
        if node.beat_at is None or (time - node.beat_at).total_seconds() > self._lease_s:
            return False
        suspected_at = self._suspected.get(node.name)
        return suspected_at is None or node.beat_at > suspected_at

    def explain_silence(self) -> str:
        """ "ok", or a message that the other servers consider this one unavailable."""
        if time.monotonic() - self._beaten_at <= self._lease_s:
            return "ok"
        return "Its heartbeat is not written: the other web servers take it for away. See the server's log."

    def list_all(self) -> list[WebNode]:
        """All servers ever registered, by name; blocks."""
        with self._db.read() as c:
            rows = c.execute(select(web_node).order_by(web_node.c.name))
            return [WebNode(**row._asdict()) for row in rows]

    def _look(self) -> None:
        self._others = {node.name: node for node in self.list_all() if node.name != self.name}

    def _write_beat(self, time: dt.datetime | None) -> bool:
        with self._db.write() as c:
            mine = (web_node.c.name == self.name, web_node.c.run == self.run)
            return bool(c.execute(update(web_node).where(*mine).values(beat_at=time)).rowcount)

    def _beat_for_ever(self) -> None:
        while not self._stop.wait(self._lease_s / 3):
            try:
                if not self._write_beat(now()):
                    log.error("another process is the web server '%s' now; this one ends", self.name)
                    self._when_fenced()
                    return
                self._beaten_at = time.monotonic()
                self._look()
            except SQLAlchemyError as error:
                log.warning(
                    "the heartbeat of this node was not written (%s); trying again", type(error).__name__
                )


def _weigh(name: str, word: str) -> bytes:
    return hashlib.sha256(f"{name}\n{word}".encode()).digest()
